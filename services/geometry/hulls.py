"""Polygons: convex hulls of text, and which way an outline turns at its corners."""

import cv2
import numpy as np

from services.arrays import Points, Vector


def text_hull(points: Points) -> Points:
    """Convex hull (K, 2) of the text, K >= 3, its corners in order; a line of text gets a little width."""
    points = points if len(points) else np.zeros((1, 2))
    size = max(float(np.ptp(points, axis=0).max()), 1e-6)
    corners = 0.01 * size * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    grown = (points[:, None, :] + corners).reshape(-1, 2)
    return np.asarray(cv2.convexHull(grown.astype(np.float32))[:, 0], np.float64)


def corner_turns(polygon: Points) -> Vector:
    """Cross products (N,) of the sides before and after each corner of a polygon (N, 2); above 0 it turns right."""
    ahead = np.roll(polygon, -1, axis=0) - polygon
    behind = np.roll(ahead, 1, axis=0)
    return np.asarray(behind[:, 0] * ahead[:, 1] - behind[:, 1] * ahead[:, 0])
