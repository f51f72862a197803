"""Sides of a sheet: which run along its text, and how straight a flat view shows them."""

import numpy as np
import pytest

from services.arrays import Points
from services.geometry.page_map import PlaneMap
from services.geometry.photo_frame import PhotoFrame
from services.sheet.developable.observations import NO_EDGES
from services.sheet.outline.results import SheetOutline, SheetSide
from services.sheet.sheet_edges import measure_sides, read_edges

VIEW = PhotoFrame(1000, 1000)
FLAT = PlaneMap(np.eye(3))
CORNERS = np.array([[200.0, 100.0], [800.0, 100.0], [800.0, 900.0], [200.0, 900.0]])


def outline(bend_px: float = 0.0, turn_rad: float = 0.0, confidence: float = 0.9) -> SheetOutline:
    """A rectangle, its top side bent by one wave."""
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    steps, sides = np.linspace(0, 1, 60)[:, None], []
    for k in range(4):
        points: Points = CORNERS[k] + steps * (CORNERS[(k + 1) % 4] - CORNERS[k])
        if k == 0:
            points = points + bend_px * np.sin(2 * np.pi * steps) * np.array([0.0, 1.0])
        points = (points - 500) @ np.array([[c, s], [-s, c]]) + 500
        sides.append(SheetSide(points, np.full(60, 0.1), 1.0, 0.0))
    return SheetOutline(CORNERS, (sides[0], sides[1], sides[2], sides[3]), confidence, CORNERS)


@pytest.mark.parametrize("direction_rad", [0.0, np.pi, np.pi / 2, 0.3, np.pi / 2 + 0.3])
def test_even_sides_run_along_the_text(direction_rad: float) -> None:
    edges = read_edges(outline(), VIEW, direction_rad)
    level = abs(np.cos(direction_rad)) > 0.7
    along_x = np.ptp(edges.points[edges.index == 0], axis=0)
    assert (along_x[0] > along_x[1]) == level
    assert edges.upright.sum() == 120
    assert np.allclose(edges.deviations, 0.1 / VIEW.unit_px)


def test_uncertain_outlines_and_sides_out_of_view_show_nothing() -> None:
    assert read_edges(None, VIEW, 0.0) is NO_EDGES
    assert np.isnan(measure_sides(FLAT, NO_EDGES))
    whole = outline()
    sides = list(whole.sides)
    sides[2] = SheetSide(np.zeros((0, 2)), np.zeros(0), 0.0, 0.0)
    cut = SheetOutline(CORNERS, (sides[0], sides[1], sides[2], sides[3]), 0.9, CORNERS)
    assert set(read_edges(cut, VIEW, 0.0).index) == {0, 1, 3}


@pytest.mark.parametrize("turn_rad", [0.0, 0.03])
def test_straightness_is_a_share_of_the_size_whatever_the_skew(turn_rad: float) -> None:
    assert measure_sides(FLAT, read_edges(outline(0.0, turn_rad), VIEW, 0.0)) < 1e-9
    wave = measure_sides(FLAT, read_edges(outline(8.0, turn_rad), VIEW, 0.0))
    # A quarter of the points lie on the bent side; the worst twentieth is left out.
    all_points = 8.0 / np.sqrt(8) / np.sqrt(600 * 800)
    assert 0.65 * all_points < wave < all_points


def test_sides_that_are_not_at_right_angles_are_off() -> None:
    sheared = PlaneMap(np.linalg.inv(np.array([[1.0, 0.02, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])))
    assert measure_sides(sheared, read_edges(outline(), VIEW, 0.0)) > 0.002
