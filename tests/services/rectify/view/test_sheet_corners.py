"""Corners of the sheet: in the order of the flat view, whichever way the photo was held."""

from dataclasses import replace

import numpy as np
import pytest

from services.arrays import Floats
from services.geometry.page_frame import mesh_of, turn_frame
from services.rectify.view.sheet_corners import corners_by_view
from services.sheet.outline.results import SheetOutline, SheetSide
from services.sheet.plane.framing import FlatFrame

SHEET = np.array([[110.0, 60.0], [520.0, 95.0], [480.0, 700.0], [90.0, 640.0]])
"""Clockwise in the photo, from its top left."""
SIDE = SheetSide(np.zeros((0, 2)), np.zeros(0), 1.0, 0.1)
OUTLINE = SheetOutline(SHEET, (SIDE, SIDE, SIDE, SIDE), 0.9, np.repeat(SHEET, 2, axis=0))


def mesh(turns: int, mirrored: bool) -> Floats:
    """The mesh of a view that is somewhat larger than the sheet, turned clockwise and perhaps mirrored."""
    frame = FlatFrame(np.array([[1.0, 0.02, 80.0], [0.05, 1.0, 45.0], [0.0, 0.0, 1.0]]), 460, 670)
    return mesh_of(turn_frame(frame, 90 * turns, mirrored), 5, 5)


@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize("mirrored", [False, True])
def test_each_corner_is_next_to_that_of_the_view(turns: int, mirrored: bool) -> None:
    view = mesh(turns, mirrored)
    found = corners_by_view(OUTLINE, view, mirrored=mirrored)
    assert found is not None
    ends = view[[0, 0, -1, -1], [0, -1, -1, 0]]
    for corner, end in zip(found, ends, strict=True):
        assert np.argmin(np.linalg.norm(SHEET - end, axis=1)) == np.argmin(
            np.linalg.norm(SHEET - corner, axis=1)
        )
    assert sorted(map(tuple, found)) == sorted(map(tuple, SHEET))


@pytest.mark.parametrize("hidden", [[0], [2], [1, 2], [0, 1, 3]])
def test_a_corner_that_was_not_seen_is_missing_in_its_place(hidden: list[int]) -> None:
    corners = SHEET.copy()
    corners[hidden] = np.nan
    whole = corners_by_view(OUTLINE, mesh(1, False), mirrored=False)
    found = corners_by_view(replace(OUTLINE, corners=corners), mesh(1, False), mirrored=False)
    assert whole is not None
    assert found is not None
    seen = np.isfinite(found).all(axis=1)
    assert (~seen).sum() == len(hidden)
    assert np.array_equal(found[seen], whole[seen])


def test_an_outline_that_is_more_likely_wrong_gives_none() -> None:
    assert corners_by_view(None, mesh(0, False), mirrored=False) is None
