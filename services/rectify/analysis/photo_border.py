"""Pages that extend beyond the photo: print at its border, and sides of an outline that are not the sheet's."""

from dataclasses import replace

import cv2
import numpy as np

from services.arrays import Points
from services.sheet.outline.results import SheetOutline

# When print counts as cut by the photo's border.
NEAR_BORDER = 2.0
"""In text heights."""
CHARACTERS = 3
"""Least number of characters near the border; one may be a speck."""
BESIDE_SHEET = 0.5
"""In text heights: print lies within the sheet's outline, or the border is a wrong outline's."""
HUGGING = 0.05
"""A side whose median point is nearer to the border than this share of the photo's long side lies on it."""


BORDERS = ("left", "top", "right", "bottom")


def border_gaps(points: Points, width: int, height: int) -> Points:
    """Distances (N, 4) in pixels of photo points (N, 2) from the borders, in the order of `BORDERS`."""
    return np.concatenate([points, np.array([width - 1, height - 1]) - points], axis=1)


def find_cut_borders(
    characters: Points, text_height_px: float, width: int, height: int, sheet: Points | None = None
) -> set[str]:
    """Those of the photo's `BORDERS` that `characters` (N, 2) run up to, on the `sheet` (M, 2) if its outline is given.

    Without it, the grain of a desk may count as print.
    """
    near = border_gaps(characters, width, height) < NEAR_BORDER * text_height_px
    if sheet is not None:
        contour, reach = sheet.astype(np.float32), BESIDE_SHEET * text_height_px
        for k in np.flatnonzero(near.any(axis=1)):
            at = (float(characters[k, 0]), float(characters[k, 1]))
            near[k] &= cv2.pointPolygonTest(contour, at, True) > -reach
    return {border for border, count in zip(BORDERS, near.sum(axis=0), strict=True) if count >= CHARACTERS}


def leave_out_borders(outline: SheetOutline, borders: set[str], width: int, height: int) -> SheetOutline:
    """The outline, with those sides unseen that lie on one of `borders`: print shows that the sheet extends beyond."""
    corners, sides = outline.corners.copy(), list(outline.sides)
    for k, side in enumerate(outline.sides):
        if not len(side.points):
            continue
        gaps = np.median(border_gaps(side.points, width, height), axis=0)
        hugged = {
            border for border, gap in zip(BORDERS, gaps, strict=True) if gap < HUGGING * max(width, height)
        }
        if hugged & borders:
            corners[[k, (k + 1) % 4]] = np.nan
            sides[k] = replace(side, seen=0.0, straightness_px=0.0)
    return replace(outline, corners=corners, sides=(sides[0], sides[1], sides[2], sides[3]))
