"""Levels that the tests make up: paper 200 with dips of known edges."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services.imaging.levels import Levels
from services.imaging.pictures import find_pictures

SHAPE = (400, 300)
DIP = (slice(120, 220), slice(80, 200))


def levels_with(
    depth: float, dip_ink: float, softness: float = 1.0, place: tuple[slice, slice] = DIP
) -> Levels:
    """Paper of 200 but for a dip, ink 0.25 of it but for `dip_ink` in the dip; the edge is `softness` wide."""
    inside = np.zeros(SHAPE, np.float32)
    inside[place] = 1.0
    soft = np.asarray(cv2.GaussianBlur(inside, (0, 0), softness), np.float32)
    paper = (200 * (1 - depth * soft)).astype(np.float32)
    ink = np.where(inside > 0, dip_ink, 0.25).astype(np.float32)
    return Levels(paper, ink, np.ones(SHAPE, np.float32))


def share(found: NDArray[np.bool_], place: tuple[slice, slice] = DIP) -> float:
    return float(found[place].mean())


@pytest.mark.parametrize("depth", [0.2, 0.4, 0.7])
def test_a_dark_box_with_light_ink_is_a_picture(depth: float) -> None:
    found = find_pictures(levels_with(depth, 0.6))
    assert share(found) > 0.97
    found[110:230, 70:210] = False
    assert not found.any()


def test_a_shadow_is_none_since_its_ink_darkens_with_its_paper() -> None:
    assert not find_pictures(levels_with(0.5, 0.27)).any()


def test_a_picture_may_have_dark_ink_where_its_levels_are_hardly_paper() -> None:
    shadow = levels_with(0.5, 0.27)
    holes = shadow.measured.copy()
    holes[120:150, 80:200] = 0.0
    assert share(find_pictures(Levels(shadow.paper, shadow.ink, holes))) > 0.97


def test_uneven_light_is_none_since_it_has_no_edge() -> None:
    unresolved = levels_with(0.3, 0.6, softness=25.0)
    blurred = Levels(unresolved.paper, np.full(SHAPE, 0.6, np.float32), unresolved.measured)
    assert not find_pictures(blurred).any()
    sharp = levels_with(0.3, 0.6)
    assert share(find_pictures(Levels(sharp.paper, blurred.ink, sharp.measured))) > 0.97


def test_what_is_dark_up_to_the_end_is_a_picture_only_by_its_ink() -> None:
    place = (slice(120, 220), slice(200, 300))
    assert share(find_pictures(levels_with(0.5, 0.65, place=place)), place) > 0.95
    assert not find_pictures(levels_with(0.5, 0.25, place=place)).any()


def test_plain_paper_has_no_pictures() -> None:
    slope = np.linspace(80, 240, SHAPE[1], dtype=np.float32)[None].repeat(SHAPE[0], axis=0)
    ones = np.ones(SHAPE, np.float32)
    assert not find_pictures(Levels(slope, 0.3 * ones, ones)).any()
    assert not find_pictures(Levels(slope, 0 * ones, ones)).any()
    assert find_pictures(Levels(slope[:1, :1], ones[:1, :1], ones[:1, :1])).shape == (1, 1)


def test_an_edge_at_the_borders_of_photos_is_one_of_their_light() -> None:
    sharp = levels_with(0.3, 0.6)
    unresolved = Levels(sharp.paper, np.full(SHAPE, 0.6, np.float32), sharp.measured)
    around = np.ones(SHAPE, bool)
    around[95:245, 55:225] = False
    around[145:195, 105:175] = True
    # Where no photo shows the dip's edge well within, nothing is known of it.
    assert not find_pictures(unresolved, around).any()
    one_side = around.copy()
    one_side[:, :140] = True
    assert share(find_pictures(unresolved, one_side)) > 0.97
