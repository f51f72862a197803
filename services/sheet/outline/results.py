"""Results of the search for a sheet's boundary in a photo."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from services.arrays import Mask, Points, Vector

LEAST_CONFIDENCE = 0.5
"""Outlines of less confidence are more often wrong than right: they are not returned."""
BELIEVED_CONFIDENCE = 0.8
"""Confidence from which on the paper ends at the outline, if it holds the text; below it, it may be that of a stack of
pages, of a whole book, or of a frame on the page."""
CERTAIN_CONFIDENCE = 0.95
"""Confidence from which on 99 % of the outlines are right: no second candidate is measured then."""


SIDE_POINTS = 60
"""Of a side that is seen whole, about."""
LEAST_POINTS = 8
"""Of a side that counts as seen: fewer tell no direction beyond their noise."""
LEAST_SEEN = 0.35
"""Share of a side on which its edge is seen; of less, the other sides tell more about where it runs."""
WHOLE_SIDE = 0.9
"""This share of a side is seen where it is seen nearly from end to end."""
CORNER_BEYOND = 0.3
"""A corner that is not seen lies at most so far outside of what is, in sizes of the sheet."""


@dataclass(frozen=True, slots=True, eq=False)
class SheetSide:
    """One side of the sheet, from corner to corner in the outline's order.

    `points` (N, 2) are photo pixels at sub-pixel accuracy, about evenly spaced, and only where the edge was seen, so
    that there may be gaps. `deviations` (N,) is one standard deviation of each point across the edge, photo
    pixels. `seen` is the share of the side's length on which an edge was seen, 0-1. `straightness_px` is the RMS
    distance of the points from their own best line.
    """

    points: Points
    deviations: Vector
    seen: float
    straightness_px: float


@dataclass(frozen=True, slots=True, eq=False)
class SheetOutline:
    """The sheet's boundary in the photo, clockwise as the photo shows it.

    `corners` (4, 2) are photo pixels: top-left, top-right, bottom-right, bottom-left; a row is NaN where the corner is
    out of view or not seen. Side k runs from corner k to corner k + 1 (top, right, bottom, left).
    `confidence` is the share of outlines of this kind that are right, 0-1. `polygon` (M, 2) is a dense closed outline
    for masks; where the sheet leaves the photo it follows the photo's border.
    """

    corners: Points
    sides: tuple[SheetSide, SheetSide, SheetSide, SheetSide]
    confidence: float
    polygon: Points

    def moved(self, x: float, y: float) -> "SheetOutline":
        """The outline of a part of the photo that begins at (x, y), in pixels of the photo."""
        by = np.array([x, y])
        top, right, bottom, left = (replace(side, points=side.points + by) for side in self.sides)
        sides = (top, right, bottom, left)
        return replace(self, corners=self.corners + by, sides=sides, polygon=self.polygon + by)

    @property
    def seen_sides(self) -> list[SheetSide]:
        """The sides of which an edge is seen."""
        return [side for side in self.sides if len(side.points) >= LEAST_POINTS]

    def holds(self, points: Points, scale: float = 0.25) -> Mask:
        """Which `points` (N, 2) lie within, to a few pixels: on a mask of `scale` times the size."""
        low = np.floor(self.polygon.min(axis=0))
        size = np.ceil((self.polygon.max(axis=0) - low) * scale).astype(int) + 1
        mask = np.zeros((size[1], size[0]), np.uint8)
        cv2.fillPoly(mask, [np.round((self.polygon - low) * scale).astype(np.int32)], 1)
        at = np.round((points - low) * scale).astype(int)
        inside = ((at >= 0) & (at < size)).all(axis=1)
        at = np.clip(at, 0, size - 1)
        return np.asarray(inside & (mask[at[:, 1], at[:, 0]] > 0))
