"""Large components that are drawn of straight lines along rows and columns: grids of forms, borders of scans."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

LEAST_SIDE_PX = 60
"""Smaller drawings are letters, boxes to tick, logos."""
MOST_INK = 0.2
"""Line drawings fill less of their box."""
_RUN_PX = 15
"""Strokes along rows or columns are at least this long, also where the page is turned by 3 degrees."""
_STRAIGHT = 0.8
"""Share of a drawing's ink in such strokes."""
_RIM = 0.03
"""Width of the rim of a box, over its side."""
_ON_RIM = 0.85
_CLOSED = 0.3
"""A shape whose cells cover less of its box is open."""
_COVERED = 0.85
"""Cells of a grid cover this share of its box."""
_LEAST_CELL_PX = 12


@dataclass(frozen=True, slots=True)
class LineDrawing:
    """What a component is as a drawing: an open border (two or three sides of a box), and the cells of its grid."""

    is_border: bool
    cells: int


NO_DRAWING = LineDrawing(is_border=False, cells=0)


def read_drawing(own: NDArray[np.bool_]) -> LineDrawing:
    """The drawing that the pixels `own` (h, w) of one component show in its box.

    The caller has seen to `LEAST_SIDE_PX` and `MOST_INK`.
    """
    height, width = own.shape
    ink = int(np.count_nonzero(own))
    image = own.astype(np.uint8)
    along, upright = (
        cv2.morphologyEx(image, cv2.MORPH_OPEN, np.ones(shape, np.uint8))
        for shape in ((1, _RUN_PX), (_RUN_PX, 1))
    )
    if np.count_nonzero(np.maximum(along, upright)) < _STRAIGHT * ink:
        return NO_DRAWING
    cells = _cells(image)
    covered = float(np.sum(cells)) / (height * width)
    across, down = 4 + round(_RIM * width), 4 + round(_RIM * height)
    on_rim = ink - int(np.count_nonzero(own[down:-down, across:-across]))
    return LineDrawing(
        is_border=covered < _CLOSED and on_rim > _ON_RIM * ink,
        cells=len(cells) if covered > _COVERED else 0,
    )


def _cells(image: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Areas of the parts of the ground that ink encloses, but for those too small to be written in."""
    ground = np.pad(1 - image, 1, constant_values=1)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(ground, connectivity=4)
    inner = np.arange(len(stats)) > 0
    inner[labels[0, 0]] = False
    sides = np.minimum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT])
    return np.asarray(stats[inner & (sides >= _LEAST_CELL_PX), cv2.CC_STAT_AREA], dtype=np.int32)
