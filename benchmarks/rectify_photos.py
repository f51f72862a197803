"""Real photos, ours and page-dewarp side by side, with the character error rate where the text is known.

python -m benchmarks.rectify_photos [--only NAME,...] [--no-peers] [--reader tesseract|rapidocr] [--fresh]
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import cv2
import numpy as np

from benchmarks.baseline import Figures, Metric, judge
from benchmarks.figures import NAN, plain_values, write_json
from benchmarks.memory import Memory
from benchmarks.options import make_parser
from benchmarks.peers import find_page_dewarp
from benchmarks.places import BASELINE, MEMORY, OUTPUT, data_folder
from benchmarks.plots import contact_sheet, load_picture, make_strip, save_picture
from benchmarks.reading import Reader, Reading, character_error_rate, character_score, make_reader
from benchmarks.stopwatch import Usage, measured
from benchmarks.subject import rectify_file
from benchmarks.workers import Progress, run_in_workers
from services.arrays import RgbImage
from services.errors import DocumentError
from services.operations import ocr_engine

_SHEET_STRIP_HEIGHT_PX = 360
SUFFIXES = (".jpg", ".jpeg", ".png")
METRICS = {
    "error_rate": Metric(0.01),
    "characters": Metric(0.5, True),
    "sure_characters": Metric(20.0, True),
}


@dataclass(frozen=True, slots=True)
class ImageFigures:
    """How one image of a photo reads: CER and character score are NaN where the text is not known."""

    width: int
    height: int
    error_rate: float
    characters: float
    sure_characters: int


@dataclass(frozen=True, slots=True)
class PhotoFigures:
    """One photo: the images by name ("photo", "rectified", "page-dewarp") and what was said of it."""

    name: str
    answer: str
    warnings: tuple[str, ...] = ()
    peer_answer: str = ""
    images: dict[str, ImageFigures] = field(default_factory=dict)
    usage: dict[str, Usage] = field(default_factory=dict)
    stages_ms: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Options:
    """What a worker needs to know."""

    reader: str
    rapidocr_python: str
    page_dewarp: str | None
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


def run_photo(path: Path, bench: Bench) -> PhotoFigures:
    """Rectify one photo by every method, and read what comes out."""
    usage: dict[str, Usage] = {}
    text = path.with_suffix(".txt")
    truth = text.read_text(encoding="utf-8") if text.is_file() else ""
    photo, call = rectify_file(path, bench.engine)
    shown: dict[str, RgbImage | None] = {"photo": photo, "rectified": None}
    warnings: tuple[str, ...] = ()
    stages: dict[str, float] = {}
    try:
        with measured() as usage["rectify"]:
            result = call()
    except DocumentError as error:
        answer = f"refused: {error.code}"
    else:
        answer = f"{result.kind}, turned {result.orientation.rotation_deg}, f {result.camera.source}"
        warnings = tuple(notice.code for notice in result.warnings)
        stages = dict(result.timings_ms)
        shown["rectified"] = result.image
    peer_answer = ""
    if bench.options.page_dewarp:
        shown["page-dewarp"], usage["page-dewarp"], peer_answer = bench.memory.page_dewarp(
            bench.options.page_dewarp, photo
        )
    images: dict[str, ImageFigures] = {}
    for name, image in shown.items():
        if image is not None:
            kept = name != "rectified"
            reading = bench.memory.read(bench.reader, image) if kept else bench.reader.read(image)
            images[name] = _judge(image, reading, truth)
    captions = [f"{name} {_caption(images.get(name))}" for name in shown]
    strip = make_strip(list(shown.values()), captions, title=f"{path.stem}: {answer}")
    save_picture(bench.options.pictures / f"{path.stem}.jpg", strip)
    captions = [_caption(images.get(name)) for name in shown]
    strip = make_strip(list(shown.values()), captions, title=path.stem, height=_SHEET_STRIP_HEIGHT_PX)
    save_picture(bench.options.pictures / "small" / f"{path.stem}.jpg", strip)
    return PhotoFigures(path.stem, answer, warnings, peer_answer, images, usage, stages)


def _judge(image: RgbImage, reading: Reading, truth: str) -> ImageFigures:
    error_rate = character_error_rate(truth, reading.text) if truth else NAN
    characters = 100 * character_score(truth.splitlines(), reading.text)
    return ImageFigures(image.shape[1], image.shape[0], error_rate, characters, reading.sure_characters)


def _caption(figures: ImageFigures | None) -> str:
    if figures is None:
        return "(none)"
    if np.isnan(figures.error_rate):
        return f"sure {figures.sure_characters}"
    return f"CER {figures.error_rate:.3f} CRS {figures.characters:.1f}"


_bench: list[Bench] = []


def _start_worker(options: Options) -> None:
    _bench.append(Bench(options))


def _work(path: Path) -> PhotoFigures:
    return run_photo(path, _bench[0])


def format_photos(photos: Sequence[PhotoFigures]) -> str:
    """One line a photo and method; CER and CRS where the text is known, else characters surely read."""
    lines = [
        f"{'photo':<24}{'image':<13}{'size':>11}{'CER':>8}{'CRS %':>8}{'sure ch.':>9}"
        f"{'CPU s':>8}{'MB':>6}  answer"
    ]
    for photo in photos:
        answers = {"rectified": photo.answer, "page-dewarp": photo.peer_answer}
        for image in ("photo", "rectified", "page-dewarp"):
            figures = photo.images.get(image)
            used = photo.usage.get({"rectified": "rectify"}.get(image, image))
            if figures is None and used is None:
                continue
            line = f"{photo.name if image == 'photo' else '':<24}{image:<13}"
            line += _figures_line(figures) if figures else f"{'-':>11}{'-':>8}{'-':>8}{'-':>9}"
            line += f"{used.cpu_s:>8.2f}{used.peak_mb:>6.0f}" if used else " " * 14
            notes = [answers.get(image, ""), *(photo.warnings if image == "rectified" else ())]
            lines.append(f"{line}  {'; '.join(note for note in notes if note)}".rstrip())
    return "\n".join(lines)


def _figures_line(figures: ImageFigures) -> str:
    size = f"{figures.width}x{figures.height}"
    known = not np.isnan(figures.error_rate)
    rates = f"{figures.error_rate:>8.3f}{figures.characters:>8.1f}" if known else f"{'':>16}"
    return f"{size:>11}{rates}{figures.sure_characters:>9}"


def figures_by_photo(photos: Sequence[PhotoFigures]) -> Figures:
    """What the baseline holds of each photo: our image's finite figures."""
    table: Figures = {}
    for photo in photos:
        image = photo.images.get("rectified")
        values = {name: float(getattr(image, name)) for name in METRICS} if image else {}
        table[photo.name] = {name: round(value, 4) for name, value in values.items() if np.isfinite(value)}
    return table


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    options = _parser().parse_args(arguments)
    folder = data_folder(options.data) / "photos"
    wanted = set(options.only.split(",")) if options.only else None
    paths = sorted(path for path in folder.glob("*") if path.suffix.lower() in SUFFIXES)
    paths = [path for path in paths if wanted is None or path.stem in wanted]
    if not paths:
        print(f"no photos in {folder}: nothing to measure (see --data)", file=sys.stderr)
        return 0
    peer = None if options.no_peers else find_page_dewarp(options.page_dewarp)
    if peer is None and not options.no_peers:
        print("page-dewarp is not installed: see --page-dewarp", file=sys.stderr)
    pictures = OUTPUT / "rectify_photos"
    memory = None if options.fresh else MEMORY
    sent = Options(options.reader, options.rapidocr_python, peer, memory, pictures)
    done: list[PhotoFigures] = []
    progress = Progress(len(paths))
    for figures in run_in_workers(_work, paths, _start_worker, sent, options.workers):
        done.append(figures)
        progress.tell(f"{figures.name}: {figures.answer}")
    done.sort(key=lambda photo: photo.name)
    print(format_photos(done))
    write_json(OUTPUT / "rectify_photos.json", [plain_values(asdict(photo)) for photo in done])
    strips = [load_picture(pictures / "small" / f"{photo.name}.jpg") for photo in done]
    save_picture(OUTPUT / "rectify_photos.png", contact_sheet(strips))
    current = figures_by_photo(done)
    verdict, good = judge(BASELINE / "rectify_photos.json", current, METRICS, update=options.update_baseline)
    print(f"\n{verdict}\nfigures and pictures: {OUTPUT}")
    return 0 if good else 1


def _parser() -> argparse.ArgumentParser:
    parser = make_parser("rectify_photos", __doc__)
    parser.add_argument("--only", default="", help="comma-separated names of photos, without suffix")
    parser.add_argument("--no-peers", action="store_true", help="ours alone")
    return parser


if __name__ == "__main__":
    sys.exit(main())
