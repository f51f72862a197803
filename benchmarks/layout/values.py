"""Values of fields from images: dates and names of made letters, memos and fax sheets, whose truth is known.

python -m benchmarks layout_values [--sizes 5,all] [--limit N]

Fields of a page are labelled from its image by models of other pages and typed by settings of the class. A value counts
where the page shows one and OCR reads it right in the zones that are known (`readable`); the percent says for how many
of these the value from the image is right. Confidences of all values that are given are compared with how many the page
shows (expected calibration error). Days of the truth are read by another library than ours.
"""

import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime

import cv2
import numpy as np
from dateutil import parser as date_parser

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.memory import Memory
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.layout.label_trust import expected_error
from benchmarks.layout.part import share, table
from benchmarks.layout.protocols import draws, folds, make_model, recognize_finely
from benchmarks.layout.specimens import load_gray
from benchmarks.layout.truth import LabelledPage, layout_folder, load_set
from services.contract.fields import FieldSetting
from services.imaging.illumination import flatten_illumination
from services.layout.content.zone_texts import fill_texts
from services.layout.learning.label_transfer import transfer_labels
from services.layout.page import Page
from services.layout.pipeline import content_features
from services.layout.recognition.fields import gather_fields
from services.layout.recognition.results import ClassMatch, Recognition, RecognizedZone
from services.layout.segmentation import FinePage, compose_page, measure_zones, segment_finely
from services.layout.values.typed_value import find_value, plain_text
from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine

NAME = "layout_values"
_WORD = r"(?:[A-Z]\.|[A-Z][a-z'-]++)(?![:\w])"
_PERSON = rf"((?:(?:Mr|Mrs|Ms|Dr|Prof)\. |Miss )?{_WORD}(?: {_WORD}){{1,3}})"
DATE = FieldSetting("date", order="MDY")
SETTINGS: Mapping[str, Mapping[str, FieldSetting]] = {
    "letter": {"date": DATE, "signature": FieldSetting("pattern", pattern=f"^{_PERSON}")},
    **{
        name: {
            "date": DATE,
            "sender": FieldSetting("pattern", pattern=rf"(?i:from):?\s?{_PERSON}"),
            "receiver": FieldSetting("pattern", pattern=rf"(?i:to):?\s?{_PERSON}"),
        }
        for name in ("memo", "fax")
    },
}
"""What a client would set for each class: dates of the United States, and names after their captions."""
SIZES = ("5", "all")
DRAWS = 2
FOLDS = 4
METRICS = {"right_percent": Metric(1.0, True), "expected_error_percent": Metric(1.0)}


@dataclass(frozen=True, slots=True, eq=False)
class ReadPage:
    """A page by its image: lines and zones of ours, with the true page and the values that OCR can give."""

    name: str
    true: Page
    fine: FinePage
    own: Page
    truth: Mapping[str, str]
    readable: Mapping[str, str | None]


def true_values(page: Page, settings: Mapping[str, FieldSetting]) -> dict[str, str]:
    """The values that a person reads, by label."""
    values = {}
    for label, setting in settings.items():
        text = plain_text("\n".join(zone.text for zone in page.zones if zone.label == label))
        if setting.type == "date":
            with suppress(ValueError, OverflowError):
                day = date_parser.parse(text, fuzzy=True, default=datetime(1, 1, 1))
                values[label] = f"{day:%Y-%m-%d}"
        elif (found := find_value(text, setting).value) is not None:
            values[label] = found
    return values


def read_pages(page: LabelledPage, engine: OcrEngine | None, memory: Memory) -> ReadPage:
    """The page by its image, read as the service reads it."""
    gray = load_gray(page.image)
    words = [] if engine is None else memory.page_words(engine, flatten_illumination(gray))
    settings = SETTINGS[page.class_name]
    blank = replace(page.page, zones=tuple(replace(zone, text="") for zone in page.page.zones))
    drawn = fill_texts(blank, words)
    labelled = tuple(
        RecognizedZone(zone, zone.label, 1.0, None, order) for order, zone in enumerate(drawn.zones)
    )
    sure = ClassMatch(page.class_name, 1, 0.0, 1.0)
    fields = gather_fields(Recognition(drawn, labelled, sure, (sure,)), settings)
    features = content_features()
    fine = segment_finely(gray, words)
    true = features.measure_page(measure_zones(gray, page.page))
    return ReadPage(
        page.name,
        true,
        fine,
        features.measure_page(transfer_labels(true, compose_page(fine))),
        true_values(page.page, settings),
        {field.label: field.value for field in fields},
    )


Counts = dict[str, list[int]]
"""Of each label: values right from images, and values that OCR can give."""
Beliefs = list[tuple[float, bool]]
"""Confidence of every value that is given, and whether the page shows it."""


def count_values(class_name: str, pages: Sequence[ReadPage], size: str) -> tuple[Counts, Beliefs, list[str]]:
    """Counts over folds or draws, confidences of values, and what is wrong, in words."""
    if size == "all":
        splits = list(folds(len(pages), FOLDS))
    else:
        drawn = draws(len(pages), int(size), DRAWS, seed=7)
        splits = [(each, [at for at in range(len(pages)) if at not in each]) for each in drawn]
    counts: Counts = {}
    beliefs: Beliefs = []
    wrong = []
    for learned, tested in splits:
        model = make_model(class_name, [(pages[at].true, pages[at].own) for at in learned])
        for at in tested:
            page = pages[at]
            seen = recognize_finely(page.fine, model)
            found = {field.label: field for field in gather_fields(seen, SETTINGS[class_name])}
            beliefs += [
                (field.confidence, page.truth.get(label) == field.value)
                for label, field in found.items()
                if label in SETTINGS[class_name] and field.value is not None
            ]
            for label, value in page.truth.items():
                if page.readable.get(label) != value:
                    continue
                given = found[label].value if label in found else None
                right, known = counts.get(label, [0, 0])
                counts[label] = [right + (given == value), known + 1]
                if given != value:
                    text = found[label].text if label in found else ""
                    wrong.append(f"{page.name} {label}: {value!r}, found {given!r} in {text!r}")
    return counts, beliefs, wrong


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    parser = make_parser(NAME, __doc__)
    parser.add_argument("--sizes", default=",".join(SIZES), help="numbers of samples, by commas")
    parser.add_argument("--limit", type=int, default=None, help="only the first N pages of each class")
    options = parser.parse_args(arguments)
    pages = load_set("letters/made", options.data)
    if not pages:
        print(f"no pages in {layout_folder(options.data)}: nothing is measured", file=sys.stderr)
        return 0
    kept = None if options.fresh else "kept"
    by_class: dict[str, list[ReadPage]] = {}
    chosen = [page for name in SETTINGS for page in pages if page.class_name == name]
    if options.limit:
        chosen = [
            page
            for name in SETTINGS
            for page in [each for each in chosen if each.class_name == name][: options.limit]
        ]
    progress = Progress(len(chosen))
    for name, page in run_in_workers(_read, chosen, _start, kept, options.workers):
        by_class.setdefault(name, []).append(page)
        progress.tell(page.name)
    tasks = [
        (name, size, sorted(read, key=lambda page: page.name))
        for name, read in by_class.items()
        for size in options.sizes.split(",")
    ]
    figures: Figures = {}
    unreadable = {
        f"{name}, {label}": [
            sum(page.readable.get(label) == page.truth[label] for page in read if label in page.truth),
            sum(label in page.truth for page in read),
        ]
        for name, read in by_class.items()
        for label in SETTINGS[name]
    }
    believed: dict[str, Beliefs] = {size: [] for size in options.sizes.split(",")}
    for name, size, (counts, beliefs, wrong) in run_in_workers(_count, tasks, _start, kept, options.workers):
        print("\n".join(f"{name}, {size} samples: {each}" for each in wrong), file=sys.stderr)
        believed[size] += beliefs
        for label, (right, known) in counts.items():
            figures[f"{name}, {size} samples, {label}"] = {
                "right_percent": share(right, known),
                "right": right,
                "readable": known,
            }
    for size in options.sizes.split(","):
        each = [f for case, f in figures.items() if f", {size} samples" in case and "right" in f]
        right, known = (sum(int(figure[key]) for figure in each) for key in ("right", "readable"))
        figures[f"all, {size} samples"] = {
            "right_percent": share(right, known),
            "right": right,
            "readable": known,
        }
        judged = np.array([c for c, _ in believed[size]]), np.array([r for _, r in believed[size]], bool)
        figures[f"confidences, {size} samples"] = {"expected_error_percent": 100 * expected_error(judged)}
    columns = ("right_percent", "right", "readable")
    rows = [[case, *(float(f[key]) for key in columns)] for case, f in figures.items() if "right" in f]
    print(table("Values right from images", ("class, samples, label", *columns), rows))
    for size, values in believed.items():
        error = figures[f"confidences, {size} samples"]["expected_error_percent"]
        print(f"Expected error of {len(values)} values' confidences, {size} samples: {error:.1f} %")
    print("Readable where zones are known: " + ", ".join(f"{k} {a}/{b}" for k, (a, b) in unreadable.items()))
    write_json(OUTPUT / f"{NAME}.json", plain_values(figures))
    if options.limit or options.sizes != ",".join(SIZES):
        return 0
    verdict, good = judge(
        BASELINE / f"{NAME}.json", plain_values(figures), METRICS, update=options.update_baseline
    )
    print(verdict, flush=True)
    return 0 if good else 1


_started: list[tuple[OcrEngine | None, Memory]] = []


def _start(memory: str | None) -> None:
    cv2.setNumThreads(1)
    _started[:] = [(open_engine(), Memory(MEMORY if memory else None))]


def _read(page: LabelledPage) -> tuple[str, ReadPage]:
    return page.class_name, read_pages(page, *_started[0])


def _count(
    task: tuple[str, str, Sequence[ReadPage]],
) -> tuple[str, str, tuple[Counts, Beliefs, list[str]]]:
    return *task[:2], count_values(task[0], task[2], task[1])
