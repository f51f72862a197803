"""Places of boxes of the flat page in the photo, through the page's mesh."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from services.arrays import Points
from services.text.page_text import Box, Quadrilateral


def locate_points(mesh: NDArray[np.float64], width: int, height: int, points: Points) -> Points:
    """Photo points (N, 2) of `points` (N, 2) of a flat page of `width` x `height` pixels; NaN where they are unknown.

    `mesh` (rows, columns, 2) has the photo point of output pixel (c (width-1)/(columns-1), r (height-1)/(rows-1)).
    Between its nodes the map is bilinear.
    """
    rows, columns = mesh.shape[:2]
    steps = np.array([columns - 1, rows - 1]) / np.maximum([width - 1, height - 1], 1)
    places = np.clip(points * steps, 0.0, [columns - 1, rows - 1])
    cells = np.minimum(places.astype(np.intp), [columns - 2, rows - 2])
    (column, row), (across, down) = cells.T, (places - cells).T[..., None]
    top = mesh[row, column] * (1 - across) + mesh[row, column + 1] * across
    bottom = mesh[row + 1, column] * (1 - across) + mesh[row + 1, column + 1] * across
    return np.asarray(top * (1 - down) + bottom * down)


def locate_boxes(
    mesh: NDArray[np.float64], width: int, height: int, boxes: Sequence[Box]
) -> tuple[Quadrilateral | None, ...]:
    """Quadrilaterals of `boxes` in the photo; None for a box with a corner that the photo does not show."""
    if not boxes:
        return ()
    table = np.array(boxes, dtype=np.float64)
    # A box ends at the edges of its pixels; coordinates are those of pixel centres.
    corners = table[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 2) - 0.5
    found = locate_points(mesh, width, height, corners).reshape(-1, 4, 2)
    return tuple(None if not np.isfinite(quad).all() else _quadrilateral(np.round(quad, 2)) for quad in found)


def _quadrilateral(quad: NDArray[np.float64]) -> Quadrilateral:
    a, b, c, d = ((float(x), float(y)) for x, y in quad)
    return a, b, c, d
