"""Convex hulls of text."""

import cv2
import numpy as np

from services.arrays import Points


def text_hull(points: Points) -> Points:
    """Convex hull (K, 2) of the text, K >= 3, its corners in order; a line of text gets a little width."""
    points = points if len(points) else np.zeros((1, 2))
    size = max(float(np.ptp(points, axis=0).max()), 1e-6)
    corners = 0.01 * size * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    grown = (points[:, None, :] + corners).reshape(-1, 2)
    return np.asarray(cv2.convexHull(grown.astype(np.float32))[:, 0], np.float64)
