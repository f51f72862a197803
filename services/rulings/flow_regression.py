"""A flow between its samples by local quadratic regression.

The dense field of `texture_flow` fits planes, and where the direction of text lines bends fastest - just where
rulings show - a plane over six text heights cuts off half of the bend: its error there is three times that of the
samples. A quadratic surface over four text heights keeps the bend.
"""

from collections.abc import Callable

import numpy as np

from services.arrays import Floats, Points, Vector
from services.texture_flow.field import FlowField, FlowSamples

_NODES = 2500
"""Bound on the nodes of the grid."""


def regress_flow(samples: FlowSamples, sigma: float, ridge: float = 0.02) -> Callable[[Points], Vector]:
    """Directions of a flow near its `samples` (N): a function of points (M, 2) in the samples' own frame.

    The doubled angles are fitted with Gaussian weights (`sigma`, in the unit of the samples' points) at the nodes of
    a grid; `ridge` holds slopes and bends that nothing measures near zero, and far away the mean direction takes over.
    """
    if len(samples) == 0:
        return lambda points: np.zeros(len(points))
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
    doubled = np.linalg.solve(normal, right)[..., 0, :]
    return FlowField(doubled, (float(low[0]), float(low[1])), spacing).at


def _gaussian(d: Floats) -> Floats:
    """exp(-d^2 / 2), and zero where that is nothing: denormal numbers would slow the products tenfold."""
    return np.asarray(np.where(np.abs(d) < 9.0, np.exp(-0.5 * d**2), 0.0))
