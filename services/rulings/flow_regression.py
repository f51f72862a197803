"""A flow between its samples by local quadratic regression.

The dense field of `texture_flow` fits planes, and where the direction of text lines bends fastest - just where
rulings show - a plane over six text heights cuts off half of the bend: its error there is three times that of the
samples. A quadratic surface over four text heights keeps the bend.
"""

from dataclasses import dataclass

import numpy as np

from services.arrays import Floats, Points, Vector
from services.rulings.tabulated import TabulatedValues
from services.texture_flow.field import FlowField, FlowSamples

_NODES = 2500
"""Bound on the nodes of the grid."""


@dataclass(frozen=True, slots=True, eq=False)
class RegressedFlow:
    """A flow at any point of its samples' frame, and how far it is to be trusted there."""

    field: FlowField | None
    trust: TabulatedValues | None

    def at(self, points: Points) -> Vector:
        """Directions (M,) rad in [-pi/2, pi/2) at `points` (M, 2)."""
        return np.zeros(len(points)) if self.field is None else self.field.at(points)

    def trust_at(self, points: Points) -> Vector:
        """Weights (M,) 0-1 at `points` (M, 2): falls where samples are few or on one side only."""
        return np.zeros(len(points)) if self.trust is None else self.trust.at(points)


def regress_flow(samples: FlowSamples, sigma: float, ridge: float = 0.02) -> RegressedFlow:
    """Directions of a flow near its `samples` (N), in the samples' own frame.

    The doubled angles are fitted with Gaussian weights (`sigma`, in the unit of the samples' points) at the nodes of
    a grid; `ridge` holds slopes and bends that nothing measures near zero, and far away the mean direction takes over.
    """
    if len(samples) == 0:
        return RegressedFlow(None, None)
    low, high = samples.points.min(axis=0) - 2 * sigma, samples.points.max(axis=0) + 2 * sigma
    spacing = max(sigma / 2, float(np.sqrt(np.prod(high - low) / _NODES)))
    x, y = (np.arange(np.ceil((high[k] - low[k]) / spacing) + 1) * spacing + low[k] for k in (0, 1))
    # Moments separate into a factor along x and one along y: small matrix products.
    gx, gy = (
        [_gaussian(d) * d**k for k in range(5)]
        for d in ((samples.points[:, 0] - x[:, None]) / sigma, (samples.points[:, 1] - y[:, None]) / sigma)
    )
    w = samples.weights
    value = np.stack([np.cos(2 * samples.angles), np.sin(2 * samples.angles)], axis=1)
    powers = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]
    moments = {(i, j): (gy[j] * w) @ gx[i].T for i in range(5) for j in range(5) if i + j <= 4}
    normal = np.stack(
        [np.stack([moments[i + k, j + m] for k, m in powers], axis=-1) for i, j in powers], axis=-2
    )
    right = np.stack(
        [np.stack([(gy[j] * (w * v)) @ gx[i].T for i, j in powers], axis=-1) for v in value.T], axis=-1
    )
    floor = 1e-3 * float(w.mean())
    held = np.arange(6)
    normal[..., held, held] += np.where(held > 0, ridge, 0.0) * normal[..., :1, 0] + floor
    right[..., 0, :] += floor * (w @ value) / max(float(w.sum()), 1e-12)
    solved = np.linalg.solve(
        normal, np.concatenate([right, np.broadcast_to(np.eye(6, 1), (*right.shape[:-1], 1))], -1)
    )
    field = FlowField(solved[..., 0, :2], (float(low[0]), float(low[1])), spacing)
    # The inverse normal matrix tells how the samples' noise comes through; at the border it is many times the usual.
    variance = TabulatedValues(solved[..., 0, 2], low, spacing)
    usual = float(np.median(variance.at(samples.points)))
    share = np.clip(2 * usual / np.maximum(variance.values, 1e-300), 0.0, 1.0)
    return RegressedFlow(field, TabulatedValues(share**2, low, spacing))


def _gaussian(d: Floats) -> Floats:
    """exp(-d^2 / 2), and zero where that is nothing: denormal numbers would slow the products tenfold."""
    return np.asarray(np.where(np.abs(d) < 9.0, np.exp(-0.5 * d**2), 0.0))
