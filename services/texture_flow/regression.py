"""Directions between their samples, by local polynomial regression of the doubled angles.

A plane (order 1) is the smoother fit of a flat page's flow. A quadric (order 2) keeps the bend of a curved page's:
where the direction of text lines turns fastest, a plane over six text heights loses half of the bend, which is three
times the error of the samples. A quadric over five text heights does not.
"""

import numpy as np

from services.arrays import Floats, Vector
from services.order_statistics import median
from services.robust import robust_scale
from services.texture_flow.field import FlowField, FlowSamples, angle_difference

_FAR_SHARE = 0.0005
"""Of a sample, weight of the far field: more of it flattens bends."""
OUTLIER_RAD = float(np.deg2rad(8.0))
"""Directions that differ from those around by more are wrong."""
_DAMPING = {1: 0.03, 2: 0.0001}
"""Of slopes and bends that nothing measures, over the samples' weight near by."""


def smooth_samples(
    samples: FlowSamples, shape: tuple[int, int], spacing_px: float, sigma_px: float, order: int = 1
) -> FlowField:
    """Dense field over an image of `shape` (rows, columns) by regression of the samples to `order` 1 or 2."""
    rows = max(int(np.ceil(shape[0] / spacing_px)) + 1, 2)
    columns = max(int(np.ceil(shape[1] / spacing_px)) + 1, 2)
    x, y = np.arange(columns) * spacing_px, np.arange(rows) * spacing_px
    return FlowField(regress_directions(samples, x, y, sigma_px, order)[0], (0.0, 0.0), spacing_px)


def reject_outliers(
    samples: FlowSamples, sigma_px: float, shape: tuple[int, int], limit_rad: float, order: int = 1
) -> FlowSamples:
    """Coherence check (2.3.2): drop samples that differ from the average of their neighbours by more.

    The limit tightens to 5 robust standard deviations where the samples agree better than `limit_rad`.
    """
    for _ in range(2):
        field = smooth_samples(samples, shape, sigma_px / 1.5, sigma_px, order)
        deviation = np.abs(angle_difference(samples.angles, field.at(samples.points)))
        kept = deviation <= float(np.clip(5 * robust_scale(deviation), limit_rad / 8, limit_rad))
        if kept.all():  # the second round would be the first
            break
        samples = samples.select(kept)
    return samples


def regress_directions(
    samples: FlowSamples, x: Vector, y: Vector, sigma: float, order: int
) -> tuple[Floats, Floats]:
    """Doubled angles (R, C, 2) at the nodes at `x` (C,) and `y` (R,), and their variance (R, C).

    At every node a polynomial is fitted with Gaussian weights (`sigma`) times the samples' own; a little of the far
    field keeps nodes without near samples defined (extrapolation). The variance is that of unit noise.
    """
    # The Gaussian separates: moments of the samples are gathered by few matrix products.
    dx = (x[:, None] - samples.points[:, 0]) / sigma
    dy = (y[:, None] - samples.points[:, 1]) / sigma
    gx, gy = (_weighted_powers(d, 2 * order) for d in (dx, dy))
    far_x, far_y = (np.exp(-0.5 * (d / 5) ** 2)[None] + 1e-6 for d in (dx, dy))
    w = samples.weights
    values = np.stack([w * np.cos(2 * samples.angles), w * np.sin(2 * samples.angles)])
    i, j = np.array([(total - k, k) for total in range(order + 1) for k in range(total + 1)]).T
    second = _moments(gx, gy, w[None], 2 * order)[:, :, 0]
    # Terms first, nodes (R, C) last.
    normal = second[j[:, None] + j, i[:, None] + i]
    right = _moments(gx, gy, values, order)[j, i]
    far_weight, *far_values = _moments(far_x, far_y, np.concatenate([w[None], values]), 0)[0, 0]
    # No samples at all: direction 0.
    far = np.stack(far_values) / np.maximum(far_weight, 1e-12)
    # The far field enters as a weak observation of the value, zero as a weak one of the slopes.
    floor = max(_FAR_SHARE * median(w), 1e-6) if len(w) else 1.0
    held = np.arange(len(i))
    normal[held, held] += np.where(held > 0, _DAMPING[order], 0.0)[:, None, None] * second[0, 0] + floor
    right[0] += floor * far
    # Only the value is asked for: slopes and bends are eliminated, at all nodes together.
    for k in held[:0:-1]:
        share = normal[:k, k] / normal[k, k]
        right[:k] -= share[:, None] * right[k]
        normal[:k, :k] -= share[:, None] * normal[k, :k]
    return np.moveaxis(right[0] / normal[0, 0], 0, -1), 1 / normal[0, 0]


def _moments(fx: Floats, fy: Floats, weights: Floats, highest: int) -> Floats:
    """Sums (P, Q, K, R, C) over N samples of weights (K, N) times `fy` (P, R, N) times `fx` (Q, C, N).

    Only those of the powers p + q up to `highest` are computed.
    """
    (rows, size), columns = fy.shape[1:], fx.shape[1]
    found = np.empty((highest + 1, highest + 1, len(weights), rows, columns))
    for power in range(highest + 1):
        others = highest + 1 - power
        left = (weights[:, None] * fy[power]).reshape(len(weights) * rows, size)
        sums = left @ fx[:others].reshape(others * columns, size).T
        found[power, :others] = sums.reshape(len(weights), rows, others, columns).transpose(2, 0, 1, 3)
    return found


def _weighted_powers(d: Floats, highest: int) -> Floats:
    """exp(-d^2 / 2) d^k (highest + 1, ...) for k from 0 on; zero where that is nothing.

    Denormal numbers would slow the products tenfold, and general powers take longer than the products.
    """
    powers = np.empty((highest + 1, *d.shape))
    powers[0] = np.where(np.abs(d) < 9.0, np.exp(-0.5 * d * d), 0.0)
    for k in range(highest):
        np.multiply(powers[k], d, out=powers[k + 1])
    return powers
