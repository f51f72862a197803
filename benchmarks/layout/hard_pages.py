"""Segmentation of pages with one difficulty each, beside the same pages without it.

python -m benchmarks layout_hard_pages [--difficulties seal,form] [--pages N] [--reading] [--sheets] [--update-baseline]

Found: true text zones that a found zone of text fits with an IoU of 0.6, in percent; without the difficulty (plain)
and with it (hard). Spurious: found zones of text, a page, that true text covers less than half of. Items: figures,
seals and handwriting that a found zone fits. `--reading` hands the engine's words to segmentation, as the service does.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import write_json
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, OUTPUT
from benchmarks.layout.part import table
from benchmarks.layout.segmentation import draw_zones
from services.imaging.illumination import flatten_illumination
from services.layout.learning.label_transfer import box_areas, shared_areas
from services.layout.page import Page, Zone
from services.layout.segmentation import segment_page
from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine
from simulation.hard_pages import DIFFICULTIES, Difficulty, hard_page
from simulation.labelled_zones import LabelledPage

NAME = "layout_hard_pages"
FOUND_IOU = 0.6
METRICS = {
    "found_percent": Metric(1.0, True),
    "spurious_per_page": Metric(0.1),
    "items_percent": Metric(5.0, True),
}


@dataclass(frozen=True, slots=True)
class Counts:
    """Sums over pages: true zones of text and items, those found, and spurious zones."""

    texts: int
    texts_found: int
    items: int
    items_found: int
    spurious: int


def true_page(page: LabelledPage) -> Page:
    """The truth of a simulated page as a page of ours."""
    zones = [Zone(zone.id, (*map(float, zone.box),), kind=zone.kind, label=zone.label) for zone in page.zones]
    return Page(float(page.width), float(page.height), tuple(zones))


def count_zones(truth: Page, found: Page) -> Counts:
    """What was found of one page."""
    is_text = np.array([zone.kind == "text" for zone in truth.zones], dtype=bool)
    found_text = np.array([zone.kind == "text" for zone in found.zones], dtype=bool)
    iou = _overlaps(truth, found)
    texts = np.any(iou[is_text][:, found_text] >= FOUND_IOU, axis=1)
    items = np.any(iou[~is_text] >= FOUND_IOU, axis=1)
    own = [zone for zone in found.zones if zone.kind == "text"]
    true_text = [zone for zone in truth.zones if zone.kind == "text"]
    covered = np.sum(shared_areas(true_text, own), axis=0) / box_areas(own) if own else np.zeros(0)
    return Counts(len(texts), int(texts.sum()), len(items), int(items.sum()), int(np.sum(covered < 0.5)))


def _overlaps(truth: Page, found: Page) -> NDArray[np.float64]:
    """IoU (true, found) of all zones."""
    if not found.zones:
        return np.zeros((len(truth.zones), 0))
    shared = shared_areas(truth.zones, found.zones)
    return np.asarray(shared / (box_areas(truth.zones)[:, None] + box_areas(found.zones)[None, :] - shared))


def measure(
    difficulty: Difficulty, pages: int, engine: OcrEngine | None, sheets: Path | None, *, plain: bool
) -> dict[str, float]:
    """Figures of one difficulty over pages of the seeds 0, 1, ..."""
    total = Counts(0, 0, 0, 0, 0)
    for seed in range(pages):
        page = hard_page(np.random.default_rng(seed), difficulty, plain=plain)
        if page.image is None:
            raise ValueError("the page was not drawn")
        words = engine.read_page(flatten_illumination(page.image)) if engine else None
        found = segment_page(page.image, words)
        truth = true_page(page)
        one = count_zones(truth, found)
        total = Counts(
            total.texts + one.texts,
            total.texts_found + one.texts_found,
            total.items + one.items,
            total.items_found + one.items_found,
            total.spurious + one.spurious,
        )
        if sheets is not None and seed == 0 and not plain:
            sheets.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(sheets / f"{difficulty}.png"), draw_zones(page.image, truth, found)[..., ::-1])
    figures = {
        "found_percent": 100.0 * total.texts_found / max(total.texts, 1),
        "spurious_per_page": total.spurious / pages,
    }
    if total.items:
        figures["items_percent"] = 100.0 * total.items_found / total.items
    return figures


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the table, compare with the baseline; its exit status."""
    parser = make_parser(NAME, __doc__)
    add = parser.add_argument
    add("--difficulties", default=",".join(DIFFICULTIES), help="which, by commas (default: all)")
    add("--pages", type=int, default=12, help="pages of each")
    add("--reading", action="store_true", help="with the words of the OCR engine")
    add("--sheets", action="store_true", help="draw a page of each with true and found zones")
    given = parser.parse_args(arguments)
    unknown = set(given.difficulties.split(",")) - set(DIFFICULTIES)
    if unknown:
        parser.error(f"no such difficulty: {', '.join(sorted(unknown))}")
    engine = open_engine() if given.reading else None
    sheets = OUTPUT / NAME if given.sheets else None
    suffix = " read" if engine else ""
    figures: Figures = {}
    rows = []
    for difficulty in [each for each in DIFFICULTIES if each in given.difficulties.split(",")]:
        plain, hard = (measure(difficulty, given.pages, engine, sheets, plain=each) for each in (True, False))
        figures[difficulty + suffix] = hard
        rows.append([difficulty, *(each.get(name) for each in (plain, hard) for name in METRICS)])
        print(f"{difficulty} done", file=sys.stderr)
    head = ["", "plain: found %", "spurious", "items %", "hard: found %", "spurious", "items %"]
    print(table("Segmentation of pages with one difficulty", head, rows))
    write_json(OUTPUT / f"{NAME}.json", figures)
    report, good = judge(BASELINE / f"{NAME}.json", figures, METRICS, update=given.update_baseline)
    print(report)
    return 0 if good else 1
