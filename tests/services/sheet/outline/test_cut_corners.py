"""Corners that are folded in, torn off or hidden by a step: the sides end before them, and meet where they would."""

from dataclasses import replace

import numpy as np
import pytest

from services.arrays import Points
from services.sheet.outline.cut_corners import end_before_cut_corners
from services.sheet.outline.results import SheetOutline, SheetSide
from simulation.pages import own_pages
from simulation.scenes import BOOK, POSES, WAVE, photograph
from tests.services.sheet.sheet_sides import bent_outline_of_truth, outline_of

CORNERS = np.array([[100.0, 120.0], [900.0, 80.0], [950.0, 1300.0], [60.0, 1250.0]])


def along(*corners: Points) -> SheetSide:
    """Sixty points along straight pieces, and their straightness as the search measures it."""
    knots = np.array(corners)
    place = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
    at = np.linspace(0.01, 0.99, 60) * place[-1]
    points = np.stack([np.interp(at, place, knots[:, k]) for k in (0, 1)], axis=1)
    points += np.random.default_rng(0).normal(0, 0.1, points.shape)
    off = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] / np.sqrt(60)
    return SheetSide(points, np.full(60, 0.1), 1.0, float(off))


def with_side(number: int, *corners: Points) -> SheetOutline:
    whole = outline_of(CORNERS, 0.1, np.random.default_rng(1))
    sides = list(whole.sides)
    sides[number] = along(*corners)
    places = whole.corners.copy()
    places[[number, (number + 1) % 4]] = corners[0], corners[-1]
    return replace(whole, sides=(sides[0], sides[1], sides[2], sides[3]), corners=places)


FOLD = (
    CORNERS[0],
    CORNERS[0] + 0.8 * (CORNERS[1] - CORNERS[0]),
    CORNERS[1] + 0.15 * (CORNERS[2] - CORNERS[1]),
)
STEP = (
    CORNERS[1] + np.array([60.0, 0.0]),
    CORNERS[1] + 0.3 * (CORNERS[2] - CORNERS[1]) + np.array([60.0, 0.0]),
    CORNERS[1] + 0.3 * (CORNERS[2] - CORNERS[1]),
    CORNERS[2],
)


@pytest.mark.parametrize(("number", "corners"), [(0, FOLD), (1, STEP)])
def test_the_corner_is_where_the_sides_meet(number: int, corners: tuple[Points, ...]) -> None:
    seen = with_side(number, *corners)
    found = end_before_cut_corners(seen)
    assert np.linalg.norm(seen.corners[1] - CORNERS[1]) > 50
    assert np.linalg.norm(found.corners[1] - CORNERS[1]) < 2
    assert np.array_equal(found.corners[[0, 2, 3]], seen.corners[[0, 2, 3]])
    assert seen.sides[number].straightness_px > 5
    assert found.sides[number].straightness_px < 0.2
    assert 0.6 <= found.sides[number].seen < 0.85
    assert len(found.sides[number].points) == len(found.sides[number].deviations)
    assert found.polygon is seen.polygon


def test_whole_sheets_and_bent_ones_stay_as_they_are() -> None:
    whole = outline_of(CORNERS, 0.3, np.random.default_rng(2))
    assert end_before_cut_corners(whole) is whole
    for shape in (BOOK, WAVE):
        truth = photograph(own_pages(200, 300)[0], POSES[0], 0.0, shape, size=(210, 270)).truth
        bent = bent_outline_of_truth(truth, 0.05, np.random.default_rng(3))
        assert end_before_cut_corners(bent) is bent


def test_a_sheet_folded_in_thirds_keeps_its_sides() -> None:
    third = (CORNERS[2] - CORNERS[1]) / 3
    aside = np.array([50.0, 0.0])
    creased = with_side(1, CORNERS[1], CORNERS[1] + third + aside, CORNERS[1] + 2 * third, CORNERS[2] + aside)
    assert end_before_cut_corners(creased) is creased
