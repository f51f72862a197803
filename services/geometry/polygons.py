"""Points within closed curves, and beyond them."""

import cv2
import numpy as np

from services.arrays import Points, Vector
from services.kernels.library import address, find_kernels


def distances_within(points: Points, polygon: Points) -> Vector:
    """Distances (N,) of `points` (N, 2) from the closed curve `polygon` (M, 2): above 0 within it, below 0 outside.

    Both are taken in single precision.
    """
    kernels = find_kernels()
    if kernels is None:
        return distances_within_plain(points, polygon)
    if not len(polygon):
        raise ValueError("a closed curve has points")
    places, corners = (
        np.ascontiguousarray(given.astype(np.float32), np.float64) for given in (points, polygon)
    )
    distances = np.empty(len(places))
    given = address(places), len(places), address(corners), len(corners)
    if not kernels.polygon_distances(*given, address(distances)):
        raise MemoryError
    return distances


def distances_within_plain(points: Points, polygon: Points) -> Vector:
    """`distances_within` without a kernel."""
    curve = polygon.astype(np.float32)
    return np.array([cv2.pointPolygonTest(curve, (float(x), float(y)), True) for x, y in points])
