"""Pages of PDFs that are set in type: their own words are their text."""

from collections.abc import Callable

import numpy as np
import pytest

from services.arrays import GrayImage
from services.contract.images import Encoding, ImageLimits
from services.contract.kept_pages import PageReading, PageWish
from services.contract.rectify import RectifyParameters, TypesetPage
from services.ocr.engine import Word
from services.operations import page_reading, rectify
from services.operations.kept_pages import render_kept_page
from tests.services.imaging.test_page_images import set_in_type
from tests.services.imaging.test_pdf_words import show, upload_of
from tests.services.operations.documents import document_of
from tests.services.operations.single_uploads import rectify_upload

pytestmark = pytest.mark.pipeline
LOGO, GARBLED = Word("LOGO", (20.0, 500.0, 200.0, 560.0), 0.9, 0), (130.0, 250.0, 400.0, 290.0)


class Reader:
    """Reads a logo, and something where the page has print; it cannot read lines."""

    name = "scripted"

    def __init__(self) -> None:
        self.pages = 0

    def read_page(self, image: GrayImage) -> list[Word]:
        self.pages += 1
        return [LOGO, Word("garbled", GARBLED, 0.9, 1)]

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        return "", 0.0


@pytest.fixture
def reader(monkeypatch: pytest.MonkeyPatch) -> Reader:
    reader = Reader()
    for module in (page_reading, rectify):
        monkeypatch.setattr(module, "ocr_engine", lambda language: reader)
    return reader


def text_of(upload: bytes) -> dict[str, object]:
    reply = rectify_upload(upload, RectifyParameters(text=True), Encoding("json"), ImageLimits())
    text = document_of(reply)["text"]
    assert isinstance(text, dict)
    return text


def words_of(text: dict[str, object]) -> list[str]:
    return [word["text"] for word in text["words"]]  # type: ignore[attr-defined]


@pytest.mark.parametrize("turn", [0, 90])
def test_a_page_without_pictures_is_not_read(reader: Reader, turn: int) -> None:
    """Whatever its language and however it lies."""
    band = "0 0 0.6 rg 0 230 400 50 re f 1 1 1 rg "
    drawing = band + show("HEADING", y=245) + "0 g " + show("Gr\xfc\xdfe aus K\xf6ln")
    text = text_of(upload_of(drawing, turn=turn))
    assert (words_of(text), text["confidence"], reader.pages) == (["HEADING", "Grüße", "aus", "Köln"], 1.0, 0)
    for word in text["words"]:  # type: ignore[attr-defined]
        x0, y0, x1, y1 = word["box"]
        assert x1 - x0 > y1 - y0, "it is upright in the view"
        across = np.ptp(np.array(word["photo"]), axis=0)
        assert (across[0] > across[1]) == (turn == 0)


def test_what_else_is_read_stays(reader: Reader) -> None:
    """A curve that is filled may be a letter of a logo."""
    text = text_of(upload_of("0 0 m 50 0 50 50 0 50 c f " + show("A line of text")))
    assert sorted(words_of(text)) == ["A", "LOGO", "line", "of", "text"]
    assert reader.pages > 0


@pytest.mark.parametrize(
    "make", [lambda: set_in_type("words and " * 40, image=True, mode=3), lambda: upload_of(show("Hi"))]
)
def test_text_of_a_scan_and_little_text_are_not_used(reader: Reader, make: Callable[[], bytes]) -> None:
    reply = rectify_upload(
        make(), RectifyParameters(text=True, on_no_text="keep"), Encoding("json"), ImageLimits()
    )
    text = document_of(reply)["text"]
    assert isinstance(text, dict)
    assert set(words_of(text)) <= {"LOGO", "garbled"}
    assert reader.pages > 0


def test_a_page_that_is_kept_has_its_words(reader: Reader, monkeypatch: pytest.MonkeyPatch) -> None:
    """A later answer turns it, and reads nothing."""
    monkeypatch.setattr(page_reading, "check_installed", lambda language: None)
    upload = upload_of(show("Gr\xfc\xdfe aus K\xf6ln"))
    reply = rectify_upload(upload, RectifyParameters(keep_photo=True), Encoding("json"), ImageLimits())
    (kept,) = reply.kept
    assert kept is not None
    origin = kept.origin()
    assert isinstance(origin, TypesetPage)
    assert origin.words
    reading = PageReading("eng")
    later, _ = render_kept_page(kept, PageWish(rotate=0), Encoding("json"), reading)
    text = document_of(later)["text"]
    assert isinstance(text, dict)
    assert (words_of(text), reader.pages) == (["Grüße", "aus", "Köln"], 0)
