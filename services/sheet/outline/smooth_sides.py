"""Smooth curves for the sides of a sheet whose followed edge has notches."""

import numpy as np

from services.arrays import Points, Vector
from services.robust import fit_reweighted, geman_mcclure_weights, robust_scale
from services.sheet.outline.corners import NOTCH, Corners, meet
from services.sheet.outline.edges import EdgePoints

LEAST_SCALE_PX = 0.3
"""Of the distances from a side: edges are measured no better."""


def smooth_sides(edge: EdgePoints, corners: Corners) -> list[Points] | None:
    """Four cubics (N, 2) from corner to corner, each through most of what was seen of its side.

    None where a corner or a side is out of view, or where the edge is nowhere far from them.
    """
    count = len(edge.points)
    if not edge.shown[corners.indices].all():
        return None
    sides, far = [], 0.0
    for start, end in zip(corners.indices, np.roll(corners.indices, -1), strict=True):
        length = int(end - start) % count
        index = (start + np.arange(length + 1)) % count
        inner = index[round(0.05 * length) : length - round(0.05 * length) + 1]
        inner = inner[edge.seen[inner]]
        if len(inner) < 10:
            return None
        curve = _RobustCubic(edge.points[inner])
        sides.append(curve)
        chord = float(np.linalg.norm(edge.points[start] - edge.points[end]))
        far = max(far, float(np.abs(curve.distance(edge.points[index])).max()) / max(chord, 1.0))
    if far < NOTCH:
        return None
    found = []
    for k in range(4):
        place = edge.points[corners.indices[k]]
        for _ in range(3):
            meeting = meet(*sides[k - 1].tangent(place), *sides[k].tangent(place))
            if meeting is None:
                return None
            place = meeting
        found.append(place)
    return [sides[k].between(found[k], found[(k + 1) % 4]) for k in range(4)]


class _RobustCubic:
    """A cubic over its own axis through most of the points (N, 2)."""

    def __init__(self, points: Points) -> None:
        self.centre = points.mean(axis=0)
        self.axes = np.linalg.svd(points - self.centre, full_matrices=False)[2]
        s, d = ((points - self.centre) @ self.axes.T).T
        self.scale = max(float(np.abs(s).max()), 1e-6)
        design = np.polynomial.polynomial.polyvander(s / self.scale, 3)
        self.fit = fit_reweighted(
            design,
            d,
            geman_mcclure_weights,
            lambda _, residuals: max(robust_scale(residuals), LEAST_SCALE_PX),
            12,
            damping=1e-9 * np.eye(4),
        )

    def _height(self, s: Vector) -> Vector:
        return np.asarray(np.polynomial.polynomial.polyval(s / self.scale, self.fit))

    def distance(self, points: Points) -> Vector:
        """Of points (N, 2), across the axis."""
        s, d = ((points - self.centre) @ self.axes.T).T
        return np.asarray(d - self._height(s))

    def tangent(self, place: Points) -> tuple[Points, Points]:
        """Point and direction of the curve next to `place` (2,)."""
        s = float((place - self.centre) @ self.axes[0])
        u = s / self.scale
        slope = (self.fit[1] + 2 * self.fit[2] * u + 3 * self.fit[3] * u * u) / self.scale
        point = self.centre + s * self.axes[0] + float(self._height(np.asarray(s))) * self.axes[1]
        return point, self.axes[0] + slope * self.axes[1]

    def between(self, start: Points, end: Points) -> Points:
        """The curve (N, 2) from next to `start` to next to `end`."""
        s = np.linspace((start - self.centre) @ self.axes[0], (end - self.centre) @ self.axes[0], 60)
        return np.asarray(self.centre + s[:, None] * self.axes[0] + self._height(s)[:, None] * self.axes[1])
