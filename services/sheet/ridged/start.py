"""Meshes that a fit may start from: the sheet between its four sides, or any map of the page whose points are known."""

from collections.abc import Callable

import cv2
import numpy as np

from services.arrays import Floats, Points, Vector
from services.geometry.homographies import transform_points
from services.sheet.ridged.mesh import SheetMesh

SIDE_BINS = 16
"""Places along a side at which its deviation from the straight line between corners is taken."""
LEAST_ROWS, MOST_ROWS = 5, 90
"""Rows of nodes: the sheet of a receipt is long."""


def mesh_between_sides(
    corners: Points, sides: tuple[Points, ...], focal: float, cells: int
) -> SheetMesh | None:
    """Mesh of `cells` columns and about as square cells between the four sides of a sheet.

    The plane through the `corners` (4, 2), centred, clockwise from the page's top left, gives depth and aspect (Zhang
    and He 2007, for a known focal length); the nodes are moved within the photo so that the border follows the `sides`
    (top, right, bottom, left; points (N, 2) each), blended into the interior (Coons). None for corners that no
    rectangle in front of the camera has.
    """
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    H = cv2.getPerspectiveTransform(square.astype(np.float32), corners.astype(np.float32)).astype(np.float64)
    M = np.diag([1 / focal, 1 / focal, 1.0]) @ H
    if (square @ M[2, :2] + M[2, 2] <= 1e-6).any() or np.linalg.det(H[:, :2][:2]) <= 0:
        return None
    width, height = np.linalg.norm(M[:, 0]), np.linalg.norm(M[:, 1])
    ratio = float(height / width)
    if not 0.05 < ratio < 20:
        return None
    rows = int(np.clip(round(ratio * cells), LEAST_ROWS - 1, MOST_ROWS - 1)) + 1
    x, y = np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, rows))
    top, right, bottom, left = (_bow(np.linalg.inv(H), side, k) for k, side in enumerate(sides))
    moved = np.stack(
        [
            x + (1 - x) * np.interp(y, *left) + x * np.interp(y, *right),
            y + (1 - y) * np.interp(x, *top) + y * np.interp(x, *bottom),
        ],
        axis=-1,
    ).reshape(-1, 2)
    seen = transform_points(H, moved)
    # Page units: those of the photo at the sheet's middle, where f / Z is one.
    middle = float(M[2, 0] / 2 + M[2, 1] / 2 + M[2, 2])
    unit = focal / middle
    depth = unit * (np.stack([x.ravel(), y.ravel()], axis=1) @ M[2, :2] + M[2, 2])
    nodes = np.column_stack([seen / focal, np.ones(len(seen))]) * depth[:, None]
    step = unit * float(width) / cells
    aspect = unit * float(height) / (rows - 1) / step
    return SheetMesh(nodes.reshape(rows, cells + 1, 3), focal, step, aspect, (0.0, 0.0))


def _bow(H_square_photo: Floats, points: Points, number: int) -> tuple[Vector, Vector]:
    """Places along side `number` of the unit square, and the deviation of its points from it there."""
    at = np.array([0.0, 1.0])
    if len(points) < 4:
        return at, np.zeros(2)
    square = transform_points(H_square_photo, points)
    along, across = square[:, number % 2], square[:, 1 - number % 2] - (number in (1, 2))
    near = (along > 0) & (along < 1) & np.isfinite(across)
    cell = np.minimum((along[near] * SIDE_BINS).astype(int), SIDE_BINS - 1)
    places, bows = [0.0], [0.0]
    for k in np.unique(cell):
        places.append(float(np.median(along[near][cell == k])))
        bows.append(float(np.median(across[near][cell == k])))
    return np.array([*places, 1.0]), np.array([*bows, 0.0])


def mesh_over(
    in_space: Callable[[Points], Floats], focal: float, low: Points, high: Points, cells: int
) -> SheetMesh | None:
    """Mesh over the page from `low` to `high` (u, v), whose points in space `in_space` gives, (N, 2) to (N, 3).

    Points that the shape does not know are continued from their neighbours; None where most are unknown.
    """
    size = np.asarray(high) - low
    rows = int(np.clip(round(float(size[1] / size[0]) * cells), LEAST_ROWS - 1, MOST_ROWS - 1)) + 1
    u, v = np.linspace(low[0], high[0], cells + 1), np.linspace(low[1], high[1], rows)
    page = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    X = in_space(page)
    known = np.isfinite(X).all(axis=1) & (X[:, 2] > 1e-3)
    if known.mean() < 0.5:
        return None
    if not known.all():
        design = np.column_stack([page, np.ones(len(page))])
        plane = np.linalg.lstsq(design[known], X[known], rcond=None)[0]
        X = np.where(known[:, None], X, design @ plane)
    step = float(size[0]) / cells
    aspect = float(size[1]) / (rows - 1) / step
    return SheetMesh(X.reshape(rows, cells + 1, 3), focal, step, aspect, (float(low[0]), float(low[1])))
