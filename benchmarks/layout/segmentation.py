"""Our page segmentation against the true zones of the labelled pages, with the engine's words and without.

python -m benchmarks layout_segmentation [--sets titles/real/jose,letters/made] [--labels] [--sheets] [--limit N]

Shares of true zones, each counted once, by the areas of boxes (benchmarks/segmentation_matching.py):

whole    one found zone has an IoU of 0.75 with it, or of 0.5 where each is the other's only partner
merged   a found zone covers half of it and half of another true zone
split    several found zones lie in it and together cover half of it
missed   found zones cover less than half of it
off      one found zone, too large or too small

and of the found zones (text and figures; rules and noise are nobody's) those that are spurious: true zones
cover less than half of them. CPU seconds are those of `segment_page`, reading not included.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.places import MEMORY, OUTPUT
from benchmarks.common.stopwatch import measured
from benchmarks.common.workers import MOST_WORKERS, Progress, run_in_workers
from benchmarks.layout.segmentation_matching import FATES, match_zones
from benchmarks.layout.truth import SETS, LabelledPage, layout_folder, load_set
from benchmarks.layout.words import PageWords
from services.arrays import GrayImage, RgbImage
from services.layout.page import Page
from services.layout.segmentation import segment_page
from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine

_COLOURS = {"text": (0, 140, 0), "figure": (200, 0, 0), "rule": (200, 0, 200), "noise": (240, 150, 0)}
_SHEET_WIDTH_PX = 620
_SHEET_PAGES = 12


@dataclass(frozen=True, slots=True)
class SetFigures:
    """Counts over the pages of one set: fates of true zones (also by label), found and spurious zones."""

    name: str
    with_words: bool
    pages: int
    zones: int
    fates: dict[str, int]
    found: int
    spurious: int
    cpu_s: list[float]
    by_label: dict[str, dict[str, int]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Options:
    """What a worker needs to know."""

    data: str | None
    words_cache: Path | None
    limit: int
    sheets: Path | None


_started: list[Options] = []
"""What this worker was started with."""


def _start(options: Options) -> None:
    cv2.setNumThreads(1)
    _started[:] = [options]


def measure_set(task: tuple[str, bool]) -> SetFigures:
    """Figures of one set, with the engine's words or without."""
    name, with_words = task
    [options] = _started
    pages = load_set(name, options.data)[: options.limit or None]
    engine: OcrEngine | None = open_engine() if with_words else None
    reader = PageWords(engine, options.words_cache)
    fates: Counter[str] = Counter()
    by_label: dict[str, Counter[str]] = {}
    found_zones = spurious = 0
    cpu_s: list[float] = []
    sheet: list[RgbImage] = []
    for page in pages:
        image = load_gray(page)
        words = reader.read(page, image) if with_words else None
        with measured() as usage:
            found = segment_page(image, words)
        cpu_s.append(usage.cpu_s)
        matching = match_zones(page.page, found)
        fates.update(matching.fates)
        for zone, fate in zip(page.page.zones, matching.fates, strict=True):
            by_label.setdefault(str(zone.label), Counter())[fate] += 1
        found_zones += len(matching.spurious)
        spurious += int(np.count_nonzero(matching.spurious))
        if options.sheets is not None and len(sheet) < _SHEET_PAGES:
            sheet.append(draw_zones(image, page.page, found))
    if options.sheets is not None and sheet:
        file = options.sheets / f"{name.replace('/', '-')}{'-words' if with_words else ''}.png"
        _write_sheet(file, sheet)
    return SetFigures(
        name,
        with_words,
        len(pages),
        sum(fates.values()),
        dict(fates),
        found_zones,
        spurious,
        cpu_s,
        {label: dict(counts) for label, counts in by_label.items()},
    )


def load_gray(page: LabelledPage) -> GrayImage:
    """The picture of a page (H, W) uint8."""
    image = cv2.imread(str(page.image), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise FileNotFoundError(page.image)
    return np.asarray(image, dtype=np.uint8)


def draw_zones(image: GrayImage, truth: Page, found: Page) -> RgbImage:
    """A page with its true zones (thin red) and the found ones, numbered in reading order, coloured by kind."""
    drawn = np.dstack([image] * 3)
    for zone in truth.zones:
        x0, y0, x1, y1 = (round(edge) for edge in zone.box)
        cv2.rectangle(drawn, (x0 - 3, y0 - 3), (x1 + 3, y1 + 3), (255, 0, 0), 1)
    for number, zone in enumerate(found.zones, 1):
        x0, y0, x1, y1 = (round(edge) for edge in zone.box)
        cv2.rectangle(drawn, (x0, y0), (x1, y1), _COLOURS[zone.kind], 2)
        cv2.putText(drawn, str(number), (x0, y0 - 2), cv2.FONT_HERSHEY_SIMPLEX, 0.6, _COLOURS[zone.kind], 2)
    size = (_SHEET_WIDTH_PX, round(image.shape[0] * _SHEET_WIDTH_PX / image.shape[1]))
    return np.asarray(cv2.resize(drawn, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _write_sheet(file: Path, pages: Sequence[RgbImage]) -> None:
    height = max(page.shape[0] for page in pages)
    cells = [np.pad(page, ((0, height - page.shape[0]), (0, 6), (0, 0))) for page in pages]
    while len(cells) % 4:
        cells.append(np.zeros_like(cells[0]))
    rows = [np.hstack(cells[first : first + 4]) for first in range(0, len(cells), 4)]
    file.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(file), np.vstack(rows)[..., ::-1])


def format_figures(figures: Sequence[SetFigures], *, labels: bool = False) -> str:
    """The table: one row a set, shares in percent; with `labels` the labels below whose zones are not all whole."""
    head = f"{'set':<24}{'words':>6}{'pages':>6}{'zones':>6}" + "".join(f"{fate:>8}" for fate in FATES)
    lines = [head + f"{'found':>7}{'spurious':>10}{'CPU s':>8}{'max':>7}"]
    for each in figures:
        row = f"{each.name:<24}{'yes' if each.with_words else 'no':>6}{each.pages:>6}{each.zones:>6}"
        row += "".join(f"{100 * each.fates.get(fate, 0) / max(each.zones, 1):>8.1f}" for fate in FATES)
        row += f"{each.found:>7}{100 * each.spurious / max(each.found, 1):>10.1f}"
        row += f"{float(np.mean(each.cpu_s)):>8.3f}{max(each.cpu_s):>7.3f}" if each.cpu_s else ""
        lines.append(row)
        for label, counts in sorted(each.by_label.items()) if labels else ():
            if counts.get("whole", 0) < sum(counts.values()):
                told = ", ".join(f"{fate} {counts[fate]}" for fate in FATES if fate in counts)
                lines.append(f"    {label:<20}{told}")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the table, write the figures; 0, or 1 where there is no data."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks layout_segmentation",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--data", default=None, help="folder of the data (default: DOCUMENT_DATA, else ../shared/data)")
    add("--sets", default=",".join(SETS), help="which sets, by commas (default: all with true zones)")
    add("--limit", type=int, default=0, help="only the first N pages of each set")
    add(
        "--words",
        choices=("both", "yes", "no"),
        default="both",
        help="with the engine's words, without, or both",
    )
    add("--words-cache", type=Path, default=MEMORY, help="folder of the words that were read (ID.pkl)")
    add("--labels", action="store_true", help="also by label")
    add("--sheets", action="store_true", help="draw pages with true and found zones")
    add("--workers", type=int, default=MOST_WORKERS, help="processes, 1 or 2")
    given = parser.parse_args(arguments)
    if not layout_folder(given.data).is_dir():
        print(f"There are no labelled pages in {layout_folder(given.data)}.", file=sys.stderr)
        return 1
    modes = {"both": (False, True), "yes": (True,), "no": (False,)}[given.words]
    tasks = [(name, with_words) for with_words in modes for name in given.sets.split(",")]
    sheets = OUTPUT / "layout_segmentation" if given.sheets else None
    options = Options(given.data, given.words_cache, given.limit, sheets)
    progress = Progress(len(tasks))
    figures = []
    for each in run_in_workers(measure_set, tasks, _start, options, given.workers):
        progress.tell(f"{each.name} {'with words' if each.with_words else ''}")
        figures.append(each)
    figures.sort(key=lambda each: tasks.index((each.name, each.with_words)))
    print(format_figures(figures, labels=given.labels))
    OUTPUT.mkdir(parents=True, exist_ok=True)
    file = OUTPUT / "layout_segmentation.json"
    file.write_text(json.dumps([asdict(each) for each in figures], indent=1), encoding="utf-8")
    return 0
