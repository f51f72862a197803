"""Mesh that a fit starts from: the sheet between its four sides."""

import cv2
import numpy as np

from services.arrays import Floats, Points, Vector
from services.geometry.homographies import transform_points
from services.sheet.ridged.mesh import LEAST_ROWS, SheetMesh

SIDE_BINS = 16
"""Places along a side at which its deviation from the straight line between corners is taken."""
MOST_ROWS = 90
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
    top, right, bottom, left = (measure_bow(np.linalg.inv(H), side, k) for k, side in enumerate(sides))
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


def measure_bow(H_square_photo: Floats, points: Points, number: int) -> tuple[Vector, Vector]:
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
