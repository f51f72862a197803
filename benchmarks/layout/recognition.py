"""Layout structure recognition on pages with labelled zones: labels, classes, a random forest beside it, speed.

python -m benchmarks layout_recognition [--parts titles,classes,...] [--limit N] [--no-reading]
"""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.memory import Memory
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.layout.classes import CLASSES
from benchmarks.layout.jobs import KeptResults, measure_all
from benchmarks.layout.labelling import LETTERS, TITLES
from benchmarks.layout.learning_curve import LEARNING, draw_curves
from benchmarks.layout.part import Part, Results, choose_parts
from benchmarks.layout.sheet import SHEETS
from benchmarks.layout.specimens import Specimen, load_specimens, segmented
from benchmarks.layout.speed import SPEED, STEPS
from benchmarks.layout.truth import layout_folder
from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine

NAME = "layout"
PARTS: dict[str, Part] = {
    "titles": TITLES,
    "classes": CLASSES,
    "learning": LEARNING,
    "letters": LETTERS,
    "steps": STEPS,
    "speed": SPEED,
    "sheet": SHEETS,
}
METRICS = {
    "error_percent": Metric(0.5),
    "learning_error_percent": Metric(0.5),
    "two_step_error_percent": Metric(0.5),
    "area_percent": Metric(0.5, True),
    "found_percent": Metric(0.5, True),
    "right_percent": Metric(0.3, True),
    "unseen_unknown_percent": Metric(1.0, True),
    "optimal_percent": Metric(0.5, True),
}
_SLOWEST_FIRST = ("classes", "learning", "titles")


@dataclass(frozen=True, slots=True)
class ReadingOptions:
    """What a worker needs to know to segment pages."""

    memory: Path | None
    reading: bool


_reader: list[tuple[OcrEngine | None, Memory]] = []


def _start_reading(options: ReadingOptions) -> None:
    cv2.setNumThreads(1)
    _reader.append((open_engine() if options.reading else None, Memory(options.memory)))


def _read(specimen: Specimen) -> Specimen:
    return segmented(specimen, *_reader[0])


def segment_all(specimens: Sequence[Specimen], options: ReadingOptions, workers: int) -> list[Specimen]:
    """The pages with zones of our own segmentation, in their order."""
    progress, done = Progress(len(specimens)), {}
    for specimen in run_in_workers(_read, specimens, _start_reading, options, workers):
        done[specimen.image] = specimen
        progress.tell(specimen.name)
    return [done[specimen.image] for specimen in specimens]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    parser = _parser()
    options = parser.parse_args(arguments)
    parts = choose_parts(parser, options, PARTS)
    specimens = load_specimens(options.data, options.limit)
    if not specimens:
        print(f"no pages in {layout_folder(options.data)}: nothing is measured", file=sys.stderr)
        return 0
    reading = ReadingOptions(None if options.fresh else MEMORY, not options.no_reading)
    specimens = segment_all(specimens, reading, options.workers)
    kept = KeptResults(None if options.fresh else MEMORY / NAME, specimens)
    results = measure_all(
        {name: PARTS[name] for name in parts}, specimens, options.workers, _SLOWEST_FIRST, kept
    )
    figures: Figures = {}
    for part in parts:
        print(f"===== {part} =====\n\n{PARTS[part].report(results[part])}\n")
        figures.update(PARTS[part].figures(results[part]))
    _save(results)
    # A figure of nothing is none.
    figures = {
        case: {name: value for name, value in row.items() if math.isfinite(value)}
        for case, row in figures.items()
    }
    if options.limit or options.no_reading:
        print("not compared with the baseline, which is of all pages, read")
        return 0
    verdict, good = judge(
        BASELINE / f"{NAME}.json", plain_values(figures), METRICS, update=options.update_baseline
    )
    print(f"{verdict}\n\nfigures and pictures: {OUTPUT}", flush=True)
    return 0 if good else 1


def _save(results: dict[str, Results]) -> None:
    for part, result in results.items():
        write_json(OUTPUT / f"{NAME}_{part}.json", plain_values(result))
    if results.get("learning"):
        draw_curves(OUTPUT / f"{NAME}_learning.png", results["learning"])


def _parser() -> argparse.ArgumentParser:
    parser = make_parser("layout_recognition", __doc__)
    add = parser.add_argument
    add("--parts", default="", help=f"only these, comma separated: {','.join(PARTS)}")
    add("--limit", type=int, default=None, help="only the first N pages of each class and set")
    add("--no-reading", action="store_true", help="segment without OCR: much faster the first time")
    return parser
