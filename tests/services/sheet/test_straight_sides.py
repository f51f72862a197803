"""Sides become straight, text stays where it is, and the map stays one-to-one."""

import numpy as np
import pytest

from services.arrays import Points
from services.geometry.page_map import PlaneMap
from services.sheet.straight_sides import StraightSidedPage, straighten_sides

PLANE = PlaneMap(np.array([[0.9, 0.05, 0.02], [-0.04, 1.0, -0.03], [0.05, 0.02, 1.0]]))
"""What the surface makes of the page: a plane, on which the sheet's sides are a little bent."""


def text(low: tuple[float, float] = (-0.4, -0.55), high: tuple[float, float] = (0.4, 0.55)) -> Points:
    """Characters in the photo, from `low` to `high` on the page."""
    grid = np.meshgrid(np.linspace(low[0], high[0], 30), np.linspace(low[1], high[1], 40))
    return PLANE.to_photo(np.stack(grid, axis=-1).reshape(-1, 2))


def sides(bend: float = 0.01, slope: float = 0.0) -> tuple[Points, Points, Points, Points]:
    """Top, right, bottom and left side in the photo, with bows of `bend`, the top one with a slope too."""
    t = np.linspace(-1, 1, 80)
    bow = bend * (1 - t**2)
    top = np.stack([0.5 * t, -0.7 + bow + slope * 0.5 * t], axis=1)
    bottom = np.stack([0.5 * t, 0.7 + bow], axis=1)
    left, right = np.stack([-0.5 - bow, 0.7 * t], axis=1), np.stack([0.5 + 0 * t, 0.7 * t], axis=1)
    return PLANE.to_photo(top), PLANE.to_photo(right), PLANE.to_photo(bottom), PLANE.to_photo(left)


def test_bent_sides_become_straight() -> None:
    found = straighten_sides(PLANE, sides(), text())
    assert isinstance(found, StraightSidedPage)
    for k, side in enumerate(sides()):
        before, page = PLANE.to_page(side), found.to_page(side)
        axis = 1 - k % 2
        assert np.ptp(page[4:-4, axis]) < 0.2 * 0.01
        if k != 1:
            assert np.ptp(before[:, axis]) == pytest.approx(0.01, rel=0.05)


def test_text_stays() -> None:
    found = straighten_sides(PLANE, sides(), text())
    inner = text((-0.38, -0.52), (0.38, 0.52))
    np.testing.assert_allclose(found.to_page(inner), PLANE.to_page(inner), atol=1e-9)


def test_the_map_is_inverted_and_its_derivatives_are_right() -> None:
    found = straighten_sides(PLANE, sides(), text())
    photo = PLANE.to_photo(np.random.default_rng(0).uniform([-0.52, -0.72], [0.52, 0.72], (300, 2)))
    np.testing.assert_allclose(found.to_photo(found.to_page(photo)), photo, atol=2e-5)
    J, step = found.jacobians(photo), 1e-6
    for axis in (0, 1):
        d = step * np.eye(2)[axis]
        slow = (found.to_page(photo + d) - found.to_page(photo - d)) / (2 * step)
        # Between bins of a side the derivative along it leaps.
        assert np.quantile(np.abs(slow - J[:, :, axis]), 0.95) < 0.02


@pytest.mark.parametrize("seen", [sides(bend=0.2), sides(slope=0.06)], ids=["another surface", "askew print"])
def test_sides_that_are_far_off_move_nothing(seen: tuple[Points, Points, Points, Points]) -> None:
    assert straighten_sides(PLANE, seen, text()) is PLANE


def test_without_sides_or_text_nothing_is_moved() -> None:
    none = np.zeros((0, 2))
    assert straighten_sides(PLANE, (none, none, none, none), text()) is PLANE
    assert straighten_sides(PLANE, sides(), none) is PLANE
