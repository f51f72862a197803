"""Pages with much text on a busy machine: is every one answered in time, and read to its end?

python -m benchmarks reading_busy [--processes N] [--photos N]

So many processes compute without end while the service reads two drawn tables of numbers and the development photos
with the most lines, one after another, with its usual limits of time. No answer may be a problem; warnings are told.
"""

import multiprocessing
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import httpx
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from benchmarks.common.options import make_parser
from benchmarks.common.places import data_folder
from benchmarks.jobs.processes import Deployment, Process
from benchmarks.reading.cases import find_cases
from simulation.language_pages import find_typeface

NAME = "reading_busy"
_PAGE_PX = (2480, 3508)
_MOST_S = 600.0
"""After this the busy processes end by themselves."""


def table_page(rows: int, columns: int, seed: int = 3) -> bytes:
    """A scanned A4 page (300 dpi, PNG) that is a ruled table of numbers.

    Raises
    ------
    RuntimeError
        Without a typeface of Latin letters.
    """
    typeface = find_typeface("Latin", [])
    if typeface is None:
        raise RuntimeError("no typeface of Latin letters is installed")
    page = Image.new("L", _PAGE_PX, 255)
    pen, rng = ImageDraw.Draw(page), np.random.default_rng(seed)
    across, down = (_PAGE_PX[0] - 240) / columns, (_PAGE_PX[1] - 240) / rows
    font = ImageFont.truetype(str(typeface), round(0.6 * down))
    for row in range(rows + 1):
        pen.line((120, 120 + row * down, _PAGE_PX[0] - 120, 120 + row * down), fill=0, width=3)
    for column in range(columns + 1):
        pen.line((120 + column * across, 120, 120 + column * across, _PAGE_PX[1] - 120), fill=0, width=3)
    for row in range(rows):
        for column in range(columns):
            place = (120 + column * across + 14, 120 + row * down + 0.12 * down)
            pen.text(place, f"{rng.integers(10, 99_999):,}.{rng.integers(10, 99)}", fill=0, font=font)
    return cv2.imencode(".png", np.asarray(page))[1].tobytes()


@contextmanager
def busy(count: int) -> Iterator[None]:
    """So many processes that compute while the block runs."""
    processes = [multiprocessing.Process(target=_compute, daemon=True) for _ in range(count)]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        for process in processes:
            process.terminate()
            process.join()


def _compute() -> None:
    # Each in a session of its own: Linux shares processors among sessions first.
    os.setsid()
    end_s = time.monotonic() + _MOST_S
    while time.monotonic() < end_s:
        sum(range(10_000))


def uploads(photos: int, data: Path) -> Iterator[tuple[str, bytes]]:
    """Names and files of what is sent."""
    for rows, columns in ((60, 8), (90, 12)):
        yield f"table of {rows} x {columns}", table_page(rows, columns)
    cases = sorted(find_cases(data, "photos"), key=lambda case: -len(case.lines))
    for case in cases[:photos]:
        yield case.path.stem, case.path.read_bytes()


def main(arguments: Sequence[str]) -> int:
    """Print a line a page; 1 if one was not answered."""
    parser = make_parser(NAME, __doc__)
    parser.add_argument("--processes", type=int, default=6)
    parser.add_argument("--photos", type=int, default=6)
    asked = parser.parse_args(arguments)
    failed, slowest_s = 0, 0.0
    with TemporaryDirectory() as folder:
        service = Process(Deployment(data_dir=folder), workers=1)
        service.start()
        try:
            with busy(asked.processes), httpx.Client(base_url=service.url, timeout=120) as client:
                for name, upload in uploads(asked.photos, data_folder(asked.data)):
                    begin_s, begin_cpu_s = time.monotonic(), service.cpu_s()
                    answer = client.post(
                        "/rectify",
                        files={"image": ("page", upload)},
                        data={"format": "txt", "on_no_text": "keep"},
                    )
                    spent_s, cpu_s = time.monotonic() - begin_s, service.cpu_s() - begin_cpu_s
                    failed += answer.status_code != 200
                    slowest_s = max(slowest_s, spent_s)
                    warnings = answer.headers.get("document-warnings", "")
                    words = len(answer.text.split()) if answer.status_code == 200 else answer.text[:200]
                    told = f"{answer.status_code}, {spent_s:5.1f} s, {cpu_s:4.1f} CPU s, {words} words"
                    print(f"{name:<40} {told} {warnings}", flush=True)
        finally:
            service.stop()
    print(f"{failed} not answered; slowest {slowest_s:.1f} s with {asked.processes} busy processes")
    return int(failed > 0)
