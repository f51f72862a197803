"""A curved page's flow between its samples, and how far it can be trusted, without the bounds of an image."""

from dataclasses import dataclass

import numpy as np

from services.arrays import Points, Vector
from services.texture_flow.field import FlowField, FlowSamples
from services.texture_flow.regression import regress_directions
from services.texture_flow.tabulated import TabulatedValues

MAX_NODES = 2500
"""Largest number of nodes of the grid over the samples."""


@dataclass(frozen=True, slots=True, eq=False)
class RegressedFlow:
    """A flow at any point of its samples' frame, and how far it is to be trusted there."""

    field: FlowField
    trust: TabulatedValues

    def at(self, points: Points) -> Vector:
        """Directions (M,) rad in [-pi/2, pi/2) at `points` (M, 2)."""
        return self.field.at(points)

    def trust_at(self, points: Points) -> Vector:
        """Weights (M,) 0-1 at `points` (M, 2): falls where samples are few or on one side only."""
        return self.trust.at(points)


def regress_flow(samples: FlowSamples, sigma: float) -> RegressedFlow:
    """Quadratic regression of `samples` (N) wherever they lie, in their own frame and its unit (as `sigma`)."""
    if len(samples) == 0:
        return RegressedFlow(
            FlowField(np.zeros((1, 1, 2)), (0.0, 0.0), sigma),
            TabulatedValues(np.zeros((1, 1)), (0.0, 0.0), sigma),
        )
    low, high = samples.points.min(axis=0) - 2 * sigma, samples.points.max(axis=0) + 2 * sigma
    spacing = max(sigma / 2, float(np.sqrt(np.prod(high - low) / MAX_NODES)))
    x, y = (np.arange(np.ceil((high[k] - low[k]) / spacing) + 1) * spacing + low[k] for k in (0, 1))
    origin = (float(low[0]), float(low[1]))
    doubled, variance = regress_directions(samples, x, y, sigma, order=2)
    # At the border of the samples their noise comes through many times as strong as usual.
    usual = float(np.median(TabulatedValues(variance, origin, spacing).at(samples.points)))
    share = np.clip(2 * usual / np.maximum(variance, 1e-300), 0.0, 1.0)
    return RegressedFlow(FlowField(doubled, origin, spacing), TabulatedValues(share**2, origin, spacing))
