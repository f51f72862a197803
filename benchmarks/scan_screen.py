"""Nine photos of 12 megapixels on the scan screen to one searchable PDF, beside nine single answers; a moved corner.

python -m benchmarks scan_screen [--pages N] [--repeats N] [--parts pdf,corners]

Needs Chromium (`make chromium`), and the data for real photos. One service with two workers answers all:

- *single*: `POST /rectify` with `format=pdf`, `text=true` and even light, one photo after another: what somebody gets
  without the page. The sum of their seconds counts.
- *screen*: all photos are chosen at once in headless Chromium; seconds from then until **Download PDF** has its file.
- *corner*: one corner of each page is moved by keys; seconds until its new picture is there, beside those of
  `POST /rectify` with the same photo, answered as the screen asks for it.

Processor seconds are those of the service (workers, server) and of the browser. Seconds are worth nothing while others
use the processors.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx
import psutil

from benchmarks.common.places import data_folder
from benchmarks.jobs.processes import Deployment, Process, cpu_s_of
from benchmarks.rectify.preview import simulated_photos
from services.imaging.page_images import is_pdf
from tests.end_to_end.page_visit import Visit, chromium, visiting

WORKERS = 2
MOST_SECONDS = 600.0
_REAL = ("planar-dark-desk", "textbook-code", "textbook-figures", "thesis-sparse", "worksheet-french")
"""All photos of the data with 12 megapixels and more."""
_SINGLE = {"format": "pdf", "text": "true", "illumination": "normalize", "on_no_text": "keep"}
_SHOWN = {
    "format": "json",
    "embed_format": "jpeg",
    "max_width": "600",
    "max_height": "852",
    "illumination": "normalize",
    "keep_photo": "true",
}
_WANTED_PDF = 0.6
_WANTED_CORNER = 1.3


@dataclass(frozen=True, slots=True)
class Spent:
    """Seconds, and processor seconds of the workers, of the server beside them, and of the browser."""

    seconds: float
    workers_s: float
    server_s: float
    browser_s: float = 0.0

    @property
    def cpu_s(self) -> float:
        """Of all processes."""
        return self.workers_s + self.server_s + self.browser_s


class Meter:
    """Processor time of a service, and of the browser that this process has started."""

    def __init__(self, service: Process) -> None:
        self._service = service

    def spent(self, work: Callable[[], float]) -> Spent:
        """What `work` takes; it returns its own seconds."""
        before = self._read()
        seconds = work()
        return Spent(seconds, *(after - first for first, after in zip(before, self._read(), strict=True)))

    def _read(self) -> tuple[float, float, float]:
        server, *workers = self._service.family()
        own = {process.pid for process in (server, *workers)}
        others = [one for one in psutil.Process().children(recursive=True) if one.pid not in own]
        return cpu_s_of(workers), cpu_s_of([server]), cpu_s_of(others)


def photo_files(folder: Path, count: int) -> list[Path]:
    """`count` photos; those of the data in turn, or simulated ones in `folder`."""
    found = [data_folder(None) / "photos" / f"{name}.jpg" for name in _REAL]
    if not all(path.is_file() for path in found):
        print("The data are not there: simulated photos.")
        found = []
        for name, upload in simulated_photos(3):
            found.append(folder / f"{name}.jpg")
            found[-1].write_bytes(upload)
    return [found[index % len(found)] for index in range(count)]


def one_by_one(client: httpx.Client, photos: Sequence[Path], options: dict[str, str]) -> float:
    """Seconds of single answers, together."""
    seconds = 0.0
    for photo in photos:
        begin_s = time.monotonic()
        answer = client.post("/rectify", files={"image": photo.read_bytes()}, data=options).raise_for_status()
        seconds += time.monotonic() - begin_s
        assert options["format"] != "pdf" or is_pdf(answer.content)
    return seconds


def to_one_pdf(visit: Visit, photos: Sequence[Path]) -> float:
    """Seconds from the choice of all photos until the PDF is there."""
    page = visit.page
    page.get_by_label("Photos").wait_for()
    begin_s = time.monotonic()
    page.get_by_label("Photos").set_input_files(photos)
    page.get_by_text(f"{len(photos)} of {len(photos)} pages are ready").wait_for(timeout=1000 * MOST_SECONDS)
    flat_s = time.monotonic() - begin_s
    with page.expect_download(timeout=1000 * MOST_SECONDS) as download:
        page.get_by_role("button", name="Download PDF").click()
    size = download.value.path().stat().st_size
    seconds = time.monotonic() - begin_s
    print(f"  all flat after {flat_s:.1f} s, the PDF of {size / 1e6:.0f} MB after {seconds:.1f} s")
    assert visit.count("POST /rectify") == len(photos)
    return seconds


def moved_corners(visit: Visit, count: int) -> float:
    """Seconds until the picture between other corners is there, of the first `count` pages together."""
    page, seconds = visit.page, 0.0
    for number in range(count):
        page.get_by_role("button", name="Corners").nth(number).click()
        corner = page.get_by_role("button", name="Corner 1")
        corner.wait_for()
        handle = corner.bounding_box()
        assert handle is not None
        x, y = handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 2, y + 2)
        begin_s = time.monotonic()
        page.mouse.up()
        page.get_by_text("The page is flat by these corners.").wait_for(timeout=1000 * MOST_SECONDS)
        seconds += time.monotonic() - begin_s
        page.get_by_role("button", name="Done").click()
    return seconds


@contextmanager
def service() -> Iterator[Process]:
    """A running service with two workers."""
    with TemporaryDirectory() as folder:
        process = Process(Deployment(data_dir=folder), workers=WORKERS)
        process.start()
        try:
            yield process
        finally:
            process.stop()


def _row(name: str, spent: Spent) -> None:
    print(
        f"{name:<10}{spent.seconds:>8.1f}{spent.cpu_s:>8.1f}{spent.workers_s:>10.1f}{spent.server_s:>8.1f}"
        f"{spent.browser_s:>9.1f}",
        flush=True,
    )


def main(arguments: Sequence[str]) -> int:
    """Print both ways in turns, and whether the screen is within what is wanted."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks scan_screen",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--pages", type=int, default=9)
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--parts", default="pdf,corners", help="only these, comma separated")
    asked = parser.parse_args(arguments)
    parts = asked.parts.split(",")
    within = True
    with TemporaryDirectory() as folder, service() as process, chromium() as browser:
        photos, meter = photo_files(Path(folder), asked.pages), Meter(process)
        different = list(dict.fromkeys(photos))
        with httpx.Client(base_url=process.url, timeout=MOST_SECONDS) as client:
            one_by_one(client, photos[:WORKERS], _SINGLE)  # fills caches
            for _ in range(asked.repeats):
                print(f"{len(photos)} photos, load {psutil.getloadavg()[0]:.1f} before")
                print(f"{'':<10}{'seconds':>8}{'CPU s':>8}{'workers':>10}{'server':>8}{'browser':>9}")
                if "pdf" in parts:
                    single = meter.spent(partial(one_by_one, client, photos, _SINGLE))
                    _row("single", single)
                with visiting(browser, process.url) as visit:
                    screen = meter.spent(partial(to_one_pdf, visit, photos))
                    if "pdf" in parts:
                        _row("screen", screen)
                        share, cpu = screen.seconds / single.seconds, screen.cpu_s / single.cpu_s
                        print(f"  {share:.2f} of the seconds (wanted: {_WANTED_PDF}), {cpu:.2f} of the CPU s")
                        within &= share <= _WANTED_PDF
                    if "corners" in parts:
                        moved = meter.spent(partial(moved_corners, visit, len(different)))
                        again = meter.spent(partial(one_by_one, client, different, _SHOWN))
                        _row("corner", moved)
                        _row("flattened", again)
                        share = moved.seconds / again.seconds
                        print(f"  {share:.2f} of the seconds of one flattening (wanted: {_WANTED_CORNER})")
                        within &= share <= _WANTED_CORNER
                    visit.check()
    return 0 if within else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
