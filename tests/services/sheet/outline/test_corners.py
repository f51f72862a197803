"""Four sides of a closed curve."""

import numpy as np
import pytest

from services.sheet.outline.corners import split_sides
from services.sheet.outline.edges import measure_closed_edge, resample_closed
from tests.services.sheet.outline.drawn import distances, draw_sheet, sides_of

CORNERS = np.array([[30.0, 40.0], [300.0, 25.0], [330.0, 420.0], [12.0, 400.0]])


@pytest.mark.parametrize("bend", [0.0, 0.1, -0.1])
def test_corners_of_bent_sheets(bend: float) -> None:
    curve = resample_closed(sides_of(CORNERS, bend), 360)
    found = split_sides(curve, np.ones(360, bool))
    assert found is not None
    away = np.linalg.norm(curve[found.indices][:, None] - CORNERS[None], axis=2)
    assert sorted(away.argmin(axis=1).tolist()) == [0, 1, 2, 3]
    assert away.min(axis=1).max() < 8
    assert found.misfit < 0.01


def test_a_folded_sheet_is_split_at_its_corners_and_not_at_its_fold() -> None:
    fold = [np.array([338.0, 200.0]), np.array([2.0, 210.0])]
    outline = np.array([CORNERS[0], CORNERS[1], fold[0], CORNERS[2], CORNERS[3], fold[1]])
    curve = resample_closed(outline, 360)
    found = split_sides(curve, np.ones(360, bool))
    assert found is not None
    away = np.linalg.norm(curve[found.indices][:, None] - CORNERS[None], axis=2)
    assert away.min(axis=1).max() < 8


def test_a_circle_has_no_four_sides_that_fit() -> None:
    angle = 2 * np.pi * np.arange(360) / 360
    circle = np.column_stack([200 + 150 * np.cos(angle), 200 + 150 * np.sin(angle)])
    square = split_sides(resample_closed(CORNERS, 360), np.ones(360, bool))
    found = split_sides(circle, np.ones(360, bool))
    assert square is not None
    assert found is None or found.misfit > square.misfit


def test_edges_are_measured_to_a_tenth_of_a_pixel() -> None:
    truth = sides_of(CORNERS, 0.04)
    photo = draw_sheet(truth, (360, 450), noise=1.0)
    # Started a pixel off, and away from the corners, which smoothing rounds.
    edge = measure_closed_edge(
        photo, resample_closed(truth, 400) + np.array([0.8, -0.6]), (0.0, 0.0, 359.0, 449.0)
    )
    clear = np.linalg.norm(edge.points[:, None] - CORNERS[None], axis=2).min(axis=1) > 12
    assert edge.seen[clear].all()
    away = distances(edge.points[clear], truth)
    assert np.median(away) < 0.1
    assert np.percentile(away, 95) < 0.35
