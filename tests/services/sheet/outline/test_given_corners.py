"""The outline through given corners: they stay where they are, its sides are followed, and not led astray."""

import cv2
import numpy as np
import pytest

from services.sheet.outline.given_corners import outline_between, with_straight_sides
from tests.services.sheet.outline.drawn import distances, draw_sheet, sides_of

SIZE = (660, 820)
CORNERS = np.array([[92.3, 71.6], [571.8, 98.2], [604.4, 741.7], [61.1, 722.9]])


@pytest.mark.parametrize("bend", [0.0, 0.02, 0.06, -0.05])
def test_corners_stay_and_sides_are_followed(bend: float) -> None:
    truth = sides_of(CORNERS, bend)
    outline = outline_between(draw_sheet(truth, SIZE), np.roll(CORNERS, 1, axis=0))
    assert np.array_equal(outline.corners, CORNERS), "in the photo's order, from its top left"
    assert outline.confidence == 1.0
    points = np.concatenate([side.points for side in outline.sides])
    assert np.percentile(distances(points, truth), 95) < 0.5
    straightness = [side.straightness_px for side in outline.sides]
    assert (straightness[0] > 3.0) == (bend != 0)
    assert straightness[1] < 0.5


def test_a_side_without_an_edge_is_straight() -> None:
    paper = (214, 212, 206)
    photo = draw_sheet(sides_of(CORNERS), SIZE, ground=paper)
    photo[:] = np.where((photo > 150).all(axis=2, keepdims=True), np.array(paper, np.uint8), photo)
    seen = outline_between(photo, CORNERS)
    assert max(side.seen for side in seen.sides) < 0.35
    for k, side in enumerate(with_straight_sides(seen).sides):
        ends = CORNERS[[k, (k + 1) % 4]]
        assert side.straightness_px < 0.5
        assert distances(side.points, np.linspace(*ends, 200)).max() < 3.5


def test_a_rule_beside_an_unseen_side_does_not_bend_it() -> None:
    photo = np.full((*SIZE[::-1], 3), 235, np.uint8)
    inner = CORNERS.mean(axis=0) + 0.92 * (CORNERS - CORNERS.mean(axis=0))
    cv2.polylines(photo, [np.round(inner).astype(np.int32)], True, (20, 20, 30), 3, cv2.LINE_AA)
    assert max(side.straightness_px for side in outline_between(photo, CORNERS).sides) < 1.0
