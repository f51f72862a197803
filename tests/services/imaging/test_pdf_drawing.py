"""PDFs that cost time or memory are refused, and only the process that draws them pays."""

import os
import subprocess
import sys
import time
from collections.abc import Callable

import psutil
import pytest
from pikepdf import Dictionary, Name

from benchmarks.attack import pdfs
from services.contract.images import DocumentLimits
from services.errors import DocumentError, TooLarge, UndecodableImage
from services.imaging.page_images import open_pages
from services.imaging.pdf_drawing import PdfLimits

pytestmark = pytest.mark.pipeline

NARROW = PdfLimits(page_processor_s=1, memory_bytes=400 * 2**20)
LONGEST_S = 15.0
"""Processor time of the longest refusal, as the contract allows; here it is 2 s."""


def refusal_of(upload: bytes, limits: PdfLimits = NARROW) -> DocumentError:
    """The error of drawing the first page, which takes little processor time and leaves no process."""
    before, there = children_s(), set(psutil.Process().children())
    with pytest.raises(DocumentError) as caught, open_pages([upload], DocumentLimits(), pdf=limits) as pages:
        pages[0].decode()
    assert children_s() - before < LONGEST_S
    assert set(psutil.Process().children()) <= there
    return caught.value


def children_s() -> float:
    times = os.times()
    return times.children_user + times.children_system


@pytest.mark.parametrize(
    ("make", "error", "told"),
    [
        (pdfs.draws_itself, UndecodableImage, "draws itself"),
        (pdfs.deep, TooLarge, "nested deeper"),
        (pdfs.exponential, TooLarge, "too often"),
        (pdfs.flate_bomb, TooLarge, "inflated"),
        (lambda: pdfs.page_of(b"n", flates=6), TooLarge, "6 filters"),
        (lambda: pdfs.strokes(200_000), TooLarge, "more than 1 s to draw"),  # 2 million need 400 MB too
        (lambda: pdfs.saved_states(4_000_000), TooLarge, "of memory"),
    ],
    ids=["draws itself", "deep", "exponential", "three filters", "six filters", "strokes", "saved states"],
)
def test_what_costs_is_refused(make: Callable[[], bytes], error: type[DocumentError], told: str) -> None:
    refusal = refusal_of(make())
    assert type(refusal) is error
    assert told in refusal.detail


def test_a_name_may_be_written_with_escapes() -> None:
    upload = pdfs.page_of(b"/#46 Do", forms=[b"/#46 Do /F Do"], cyclic=True)
    assert "draws itself" in refusal_of(upload).detail


def test_resources_that_name_their_own_form_are_no_cycle() -> None:
    """Many writers give all forms the resources of the page. A form draws itself only if its content says so."""
    upload = pdfs.page_of(b"/F Do", forms=[b"0 0 300 300 re f"], cyclic=True)
    with open_pages([upload], DocumentLimits(), pdf=NARROW) as pages:
        assert pages[0].decode().pixels.min() == 0


def test_forms_within_forms_are_drawn() -> None:
    upload = pdfs.page_of(b"/F Do", forms=[b"0 0 300 300 re f", *[b"/F Do"] * 8])
    with open_pages([upload], DocumentLimits(), pdf=NARROW) as pages:
        picture = pages[0].decode().pixels
    assert picture[-1, 0].max() == 0
    assert picture[0, -1].min() == 255


def test_pages_of_a_file_share_one_process_and_one_limit() -> None:
    upload = pdfs.page_of(b"0 0 m 9 9 l S", options=Dictionary(Font=Dictionary(), X=Name.Y))
    there = set(psutil.Process().children())
    with open_pages([upload, upload], DocumentLimits(), pdf=NARROW) as pages:
        assert len(set(psutil.Process().children()) - there) == 2
        assert [page.decode().pixels.shape for page in pages] == [(2339, 1653, 3)] * 2
    assert set(psutil.Process().children()) <= there


def test_a_process_starts_without_numpy() -> None:
    """Its import was half of the start, and each PDF has a process of its own."""
    look = "import sys, services.imaging.pdf_process; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", look], check=False).returncode == 0


def test_a_process_that_was_killed_is_a_refusal() -> None:
    there = set(psutil.Process().children())
    with open_pages([pdfs.page_of(b"n")], DocumentLimits(), pdf=NARROW) as pages:
        (child,) = set(psutil.Process().children()) - there
        child.kill()
        started = time.monotonic()
        with pytest.raises(TooLarge):
            pages[0].decode()
        assert time.monotonic() - started < LONGEST_S
