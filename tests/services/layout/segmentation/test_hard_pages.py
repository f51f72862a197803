"""What segmentation meets on real pages: print in figures, forms, line numbers, narrow gutters, borders of scans."""

import cv2
import numpy as np
import pytest

from services.layout.page import Box, Zone
from services.layout.segmentation import segment_finely, segment_page
from services.layout.segmentation.line_drawings import read_drawing
from services.ocr.engine import Word
from services.ocr.word_trust import probability_right
from simulation.hard_pages import Difficulty, hard_page
from simulation.labelled_zones import LabelledPage

pytestmark = pytest.mark.pipeline

SEEDS = (0, 1, 2)


def zones_of(page: LabelledPage, words: list[Word] | None = None) -> tuple[Zone, ...]:
    assert page.image is not None
    return segment_page(page.image, words).zones


def overlap(one: tuple[float, ...], other: tuple[float, ...]) -> float:
    """Intersection over union of two boxes."""
    across = min(one[2], other[2]) - max(one[0], other[0])
    down = min(one[3], other[3]) - max(one[1], other[1])
    shared = max(across, 0.0) * max(down, 0.0)
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (one, other)]
    return shared / (sum(areas) - shared)


def share_found(difficulty: Difficulty, *, plain: bool) -> float:
    """Share of the true zones of text that a found one fits."""
    found = total = 0
    for seed in SEEDS:
        page = hard_page(np.random.default_rng(seed), difficulty, plain=plain)
        own = [zone.box for zone in zones_of(page) if zone.kind == "text"]
        for zone in page.zones:
            if zone.kind == "text":
                total += 1
                found += any(overlap(zone.box, box) >= 0.6 for box in own)
    return found / total


@pytest.mark.parametrize(
    "difficulty", ["form", "line-numbers", "dark-border", "three-columns", "page-number", "listing"]
)
def test_a_difficulty_costs_no_zones(difficulty: Difficulty) -> None:
    assert share_found(difficulty, plain=False) >= share_found(difficulty, plain=True) - 0.02


def test_words_in_a_figure_are_the_figure_s() -> None:
    page = hard_page(np.random.default_rng(0), "figure-words")
    [true] = [zone for zone in page.zones if zone.kind == "figure"]
    x0, y0, _, y1 = true.box
    inner = Word("optimization", (x0 + 100.0, y0 + 88.0, x0 + 250.0, y0 + 112.0), 0.95)
    above = Word("Earlier", (150.0, 140.0, 215.0, 160.0), 0.95)
    found = zones_of(page, [above, inner])
    [figure] = [zone for zone in found if zone.kind == "figure"]
    assert overlap(figure.box, true.box) > 0.9
    assert [(word.text, word.confidence) for word in figure.words] == [
        ("optimization", probability_right(0.95))
    ]
    assert figure.text == ""
    within = [zone for zone in found if zone.kind == "text" and y0 < zone.box[1] and zone.box[3] < y1]
    assert within == []
    assert any("Earlier" in zone.text for zone in found if zone.kind == "text")


def test_a_border_round_running_text_takes_none_of_it() -> None:
    page = hard_page(np.random.default_rng(1), "page-number")
    assert page.image is not None
    image = page.image.copy()
    x = np.linspace(60, page.width - 60, 400)
    for y in (40, page.height - 40):
        wave = np.column_stack([x, y + 12 * np.sin(x / 9)]).astype(np.int32)
        cv2.polylines(image, [wave], False, 0, 3)
    for column in (60, page.width - 60):
        cv2.line(image, (column, 40), (column, page.height - 40), 0, 3)
    plain = [zone.text or zone.box for zone in zones_of(page) if zone.kind == "text"]
    framed = [zone.text or zone.box for zone in segment_page(image, None).zones if zone.kind == "text"]
    assert len(framed) >= len(plain) - 1


def test_line_numbers_are_a_zone_and_no_text_has_them() -> None:
    page = hard_page(np.random.default_rng(0), "line-numbers")
    [true] = [zone for zone in page.zones if zone.label == "line-numbers"]
    found = [zone for zone in zones_of(page) if zone.kind == "text"]
    assert sum(overlap(zone.box, true.box) > 0.6 for zone in found) == 1
    assert all(zone.box[0] > true.box[2] for zone in found if overlap(zone.box, true.box) < 0.6)


def test_marks_of_a_short_list_stay_with_their_entries() -> None:
    image = np.full((1754, 1240), 255, np.uint8)
    for row in range(6):
        at = (100, 300 + 40 * row)
        cv2.putText(image, f"{row + 1}", at, cv2.FONT_HERSHEY_SIMPLEX, 0.7, 0, 2)
        cv2.putText(image, "entry of a list in print", (150, at[1]), cv2.FONT_HERSHEY_SIMPLEX, 0.7, 0, 2)
    left = [zone.box[0] for zone in segment_page(image, None).zones]
    assert all(edge < 120 for edge in left)


def drawn(*boxes: Box, size: tuple[int, int] = (400, 600)) -> np.ndarray:
    image = np.zeros(size, np.uint8)
    for x0, y0, x1, y1 in boxes:
        cv2.rectangle(image, (int(x0), int(y0)), (int(x1), int(y1)), 1, 2)
    return image.astype(bool)


def test_drawings_are_told_by_their_lines() -> None:
    grid = drawn(
        *((300.0 * c, 100.0 * r, 300.0 * c + 299, 100.0 * r + 99) for c in range(2) for r in range(4))
    )
    assert read_drawing(grid).cells >= 8
    assert not read_drawing(grid).is_border
    corner = np.zeros((400, 600), bool)
    corner[-3:] = corner[:, -3:] = True
    assert read_drawing(corner).is_border
    boxes = drawn((0, 0, 150, 100), (400, 300, 599, 399))
    boxes[48:50, 150:500] = boxes[48:300, 498:500] = True
    assert read_drawing(boxes).cells == 0
    assert not read_drawing(boxes).is_border
    y, x = np.indices((300, 300))
    circle = np.abs(np.hypot(x - 150, y - 150) - 145) < 3
    assert read_drawing(circle) == read_drawing(np.zeros((300, 300), bool))


def test_the_lines_of_a_listing_are_whole() -> None:
    for seed in SEEDS:
        page = hard_page(np.random.default_rng(seed), "listing")
        assert page.image is not None
        [true] = [zone for zone in page.zones if zone.label == "listing"]
        boxes = segment_finely(page.image, None).boxes
        middle = (boxes[:, 1] + boxes[:, 3]) / 2
        assert np.count_nonzero((middle > true.box[1]) & (middle < true.box[3])) == true.lines
