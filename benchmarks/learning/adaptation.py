"""Adaptive learning: rounds of training, streams of feedback, one correction, wrong classes, the time it takes.

python -m benchmarks learning [--parts rounds,streams,...] [--limit N] [--no-reading]

What was measured before is found again as long as neither the pages nor the code have changed (--fresh does without).
"""

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT
from benchmarks.layout.jobs import KeptResults, measure_all
from benchmarks.layout.part import Part, Results, choose_parts
from benchmarks.layout.recognition import ReadingOptions, segment_all
from benchmarks.layout.specimens import OTHER_LETTERS, Specimen, load_specimens
from benchmarks.layout.truth import layout_folder
from benchmarks.learning.classes import FEEDBACK_CLASSES
from benchmarks.learning.image_streams import IMAGE_ONCE, IMAGE_STREAMS
from benchmarks.learning.once import ONCE
from benchmarks.learning.rounds import ROUNDS, draw_rounds
from benchmarks.learning.speed import ADAPTATION_SPEED
from benchmarks.learning.streams import STREAMS, draw_streams

NAME = "learning"
PARTS: dict[str, Part] = {
    "rounds": ROUNDS,
    "streams": STREAMS,
    "once": ONCE,
    "classes": FEEDBACK_CLASSES,
    "speed": ADAPTATION_SPEED,
    "image-streams": IMAGE_STREAMS,
    "image-once": IMAGE_ONCE,
}
PICTURES: dict[str, Callable[[Path, Results], None]] = {"rounds": draw_rounds, "streams": draw_streams}
METRICS = {
    "rounds_error_percent": Metric(0.5),
    "stream_error_percent": Metric(0.5),
    "same_left_percent": Metric(3.0),
    "image_stream_zones_percent": Metric(3.0),
    "image_stream_words_percent": Metric(2.0),
    "image_spared_percent": Metric(5.0, True),
    "class_error_percent": Metric(3.0),
    "others_right_percent": Metric(0.5, True),
}
_SLOWEST_FIRST = ("rounds", "once")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    parser = _parser()
    options = parser.parse_args(arguments)
    names = choose_parts(parser, options, PARTS)
    specimens = load_specimens(options.data, options.limit)
    if not specimens:
        print(f"no pages in {layout_folder(options.data)}: nothing is measured", file=sys.stderr)
        return 0
    memory = None if options.fresh else MEMORY
    if "classes" in names:
        specimens = _with_memos_segmented(
            specimens, ReadingOptions(memory, not options.no_reading), options.workers
        )
    kept = KeptResults(None if memory is None else memory / NAME, specimens)
    parts = {name: PARTS[name] for name in names}
    results = measure_all(parts, specimens, options.workers, _SLOWEST_FIRST, kept)
    figures: Figures = {}
    for name, part in parts.items():
        print(f"===== {name} =====\n\n{part.report(results[name])}\n", flush=True)
        figures.update(part.figures(results[name]))
        write_json(OUTPUT / f"{NAME}_{name}.json", plain_values(results[name]))
        if name in PICTURES and results[name]:
            PICTURES[name](OUTPUT / f"{NAME}_{name}.png", results[name])
    figures = {
        case: {name: value for name, value in row.items() if math.isfinite(value)}
        for case, row in figures.items()
    }
    if options.limit or options.no_reading:
        print("not compared with the baseline, which is of all pages, read")
        return 0
    path = BASELINE / f"{NAME}.json"
    verdict, good = judge(path, plain_values(figures), METRICS, update=options.update_baseline)
    print(f"{verdict}\n\nfigures and pictures: {OUTPUT}", flush=True)
    return 0 if good else 1


def _with_memos_segmented(
    specimens: Sequence[Specimen], reading: ReadingOptions, workers: int
) -> list[Specimen]:
    """Own zones for the pages that have no others."""
    chosen = [specimen for specimen in specimens if specimen.source == OTHER_LETTERS]
    segmented = iter(segment_all(chosen, reading, workers)) if chosen else iter(())
    return [next(segmented) if specimen.source == OTHER_LETTERS else specimen for specimen in specimens]


def _parser() -> argparse.ArgumentParser:
    parser = make_parser(NAME, __doc__)
    add = parser.add_argument
    add("--parts", default="", help=f"only these, comma separated: {','.join(PARTS)}")
    add("--limit", type=int, default=None, help="only the first N pages of each class and set")
    add("--no-reading", action="store_true", help="segment the real memos without OCR")
    return parser
