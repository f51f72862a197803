"""A texture flow at any point, from its samples, without flattening its bends.

The analysis' dense fields (2.3) average over windows as wide as several text lines: on a planar page that only takes
away noise, but where a page bends it takes away the bend, by 0.5 degrees in the middle and by several at the
borders. Samples are far better than that. A thin plate through them follows bends, and goes on steadily outside.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree

from services.arrays import Points, Vector
from services.texture_flow.field import FlowSamples, angle_difference

_MAX_SAMPLES = 900
"""Enough for any page (the analysis finds 200-600); more cost their third power."""
_SMOOTHING = 1e-3
"""Of the thin plate, at weight 1 and half a diagonal as unit."""
_ROUNDS = 3
_LEAST_WEIGHT = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class InterpolatedFlow:
    """A flow's direction at any point, and how near its samples are."""

    _deviation: RBFInterpolator
    _tree: cKDTree
    _spacing: float
    _mean: float

    def at(self, points: Points) -> Vector:
        """Direction (N,) rad at `points` (N, 2) in the samples' own frame."""
        return np.asarray(self._mean + self._deviation(points))

    def support(self, points: Points) -> Vector:
        """1 among samples, falling to 0 beyond them, (N,)."""
        distance, _ = self._tree.query(points)
        return np.asarray(np.exp(-((distance / self._spacing) ** 2) / 2))


def interpolate_flow(samples: FlowSamples) -> InterpolatedFlow | None:
    """Thin plate through `samples` (centred unit coordinates), reweighted against wild ones; None below 4 of them."""
    samples = samples.select(np.arange(len(samples)) % (len(samples) // _MAX_SAMPLES + 1) == 0)
    points, first = np.unique(samples.points, axis=0, return_index=True)
    if len(points) < 4 or np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] < 1e-6:
        return None  # a plane through fewer samples, or through samples in a row, is no flow
    angles, weights = samples.angles[first], samples.weights[first]
    mean = 0.5 * float(np.arctan2(weights @ np.sin(2 * angles), weights @ np.cos(2 * angles)))
    deviation = angle_difference(angles, mean)
    trust = np.ones(len(points))
    for _ in range(_ROUNDS):
        smoothing = _SMOOTHING / np.maximum(weights * trust, _LEAST_WEIGHT)
        plate = RBFInterpolator(points, deviation, smoothing=smoothing, kernel="thin_plate_spline")
        residuals = deviation - plate(points)
        scale = max(1.4826 * float(np.median(np.abs(residuals))), 1e-3)
        trust = 1 / (1 + (residuals / (2 * scale)) ** 2)
    tree = cKDTree(points)
    nearest, _ = tree.query(points, k=2)
    return InterpolatedFlow(plate, tree, float(np.median(nearest[:, 1])), mean)
