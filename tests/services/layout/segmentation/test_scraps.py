"""What is no running text: drawings, signatures over print, dirt, broken rules, lists in a margin."""

import cv2
import numpy as np
import pytest

from services.arrays import GrayImage
from services.layout.page import Box, Page, Zone
from services.layout.segmentation import segment_page
from services.layout.segmentation.gathering import trim_figures
from tests.services.layout.segmentation.test_breaks import blank, letter_with_foot, lines_of_zones, put


def of_kind(image: GrayImage, kind: str) -> list[Zone]:
    return [zone for zone in segment_page(image, None).zones if zone.kind == kind]


def below(page: Page, y: float) -> list[Zone]:
    return [zone for zone in page.zones if zone.box[1] > y]


def test_frames_and_circles_of_a_drawing_are_a_figure_and_no_text() -> None:
    image = letter_with_foot([])
    for k in range(4):
        cv2.rectangle(image, (200 + 90 * k, 800), (260 + 90 * k, 850), 0, 1)
        cv2.circle(image, (230 + 90 * k, 790), 18, 0, 1, cv2.LINE_AA)
    found = below(segment_page(image, None), 600)
    assert "text" not in {zone.kind for zone in found}
    assert len(found) >= 1


def test_pieces_of_a_signature_are_one_figure() -> None:
    image = letter_with_foot([])
    x = np.arange(200, 420)
    strokes = np.column_stack([x, 850 + 40 * np.sin(x / 12.0)]).astype(np.int32)
    cv2.polylines(image, [strokes], False, 0, 4, cv2.LINE_AA)
    for at in (432, 452, 470):
        cv2.line(image, (at, 840), (at + 6, 862), 0, 4, cv2.LINE_AA)
    cv2.line(image, (440, 866), (462, 874), 0, 4, cv2.LINE_AA)
    [figure] = below(segment_page(image, None), 600)
    assert figure.kind == "figure"
    assert figure.box[0] < 205
    assert figure.box[2] > 470


def test_a_figure_begins_below_the_line_that_it_crosses_with_its_upper_end() -> None:
    closing = Zone("", (100.0, 100.0, 300.0, 120.0), kind="text", lines=1)
    signature: Box = (90.0, 95.0, 340.0, 200.0)
    stamp: Box = (90.0, 40.0, 340.0, 200.0)
    flat: Box = (90.0, 95.0, 340.0, 130.0)

    def trimmed(box: Box) -> Box:
        zones = [closing, Zone("", box, kind="figure")]
        text, figure = trim_figures(zones)
        assert text == closing
        return figure.box

    assert trimmed(signature) == (90.0, 120.0, 340.0, 200.0)
    assert trimmed(stamp) == stamp
    assert trimmed(flat) == flat


def test_dirt_gives_no_zone() -> None:
    image = letter_with_foot([])
    rng = np.random.default_rng(4)
    for x, y in rng.integers([60, 500], [940, 1340], (80, 2)):
        cv2.ellipse(image, (int(x), int(y)), (9, 3), float(rng.uniform(0, 180)), 0, 360, 0, -1)
    assert not [zone for zone in segment_page(image, None).zones if zone.kind in ("noise", "figure")]


def test_pieces_of_a_broken_rule_are_one_and_a_double_rule_is_two() -> None:
    image = letter_with_foot([])
    for start in range(100, 800, 180):
        image[900:902, start : start + 150] = 0
        image[930:932, start : start + 150] = 0
    rules = of_kind(image, "rule")
    assert len(rules) == 2
    for rule in rules:
        assert (rule.box[0], rule.box[2]) == pytest.approx((100, 790), abs=2)


def items(mark: bool) -> GrayImage:
    image = blank()
    for row in range(5):
        put(image, "This is the body of a letter that is drawn", 100, 300 + 30 * row, width=520)
    for row, text in enumerate(["Review of it", "Repository", "Archive"]):
        y = 800 + 46 * row
        if mark:
            cv2.circle(image, (106, y - 6), 4, 0, -1)
        put(image, text, 130, y)
    return image


def test_short_items_with_marks_are_one_list_however_far_they_stand_apart() -> None:
    assert lines_of_zones(items(True)) == [5, 3]
    assert len(lines_of_zones(items(False))) == 4
