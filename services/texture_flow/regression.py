"""Directions between their samples, by local polynomial regression of the doubled angles.

A plane (order 1) is the smoother fit of a flat page's flow. A quadric (order 2) keeps the bend of a curved page's:
where the direction of text lines turns fastest, a plane over six text heights loses half of the bend, which is three
times the error of the samples. A quadric over five text heights does not.
"""

import numpy as np

from services.arrays import Floats, Vector
from services.robust import robust_scale
from services.texture_flow.field import FlowField, FlowSamples, angle_difference

_FAR_SHARE = 0.0005
"""Of a sample, weight of the far field: more of it flattens bends."""
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
        limit = float(np.clip(5 * robust_scale(deviation), limit_rad / 8, limit_rad))
        samples = samples.select(deviation <= limit)
    return samples


def regress_directions(
    samples: FlowSamples, x: Vector, y: Vector, sigma: float, order: int
) -> tuple[Floats, Floats]:
    """Doubled angles (R, C, 2) at the nodes at `x` (C,) and `y` (R,), and their variance (R, C).

    At every node a polynomial is fitted with Gaussian weights (`sigma`) times the samples' own; a little of the far
    field keeps nodes without near samples defined (extrapolation). The variance is that of unit noise.
    """
    # The Gaussian separates: moments of the samples are gathered by small matrix products.
    dx = (x[:, None] - samples.points[:, 0]) / sigma
    dy = (y[:, None] - samples.points[:, 1]) / sigma
    gx, gy = ([_gaussian(d) * d**i for i in range(2 * order + 1)] for d in (dx, dy))
    far_x, far_y = np.exp(-0.5 * (dx / 5) ** 2) + 1e-6, np.exp(-0.5 * (dy / 5) ** 2) + 1e-6
    value = np.stack([np.cos(2 * samples.angles), np.sin(2 * samples.angles)], axis=1)
    w = samples.weights

    def moment(fx: Floats, fy: Floats, v: Vector) -> Floats:
        return np.asarray((fy * v) @ fx.T)

    terms = [(total - j, j) for total in range(order + 1) for j in range(total + 1)]
    second = {(i, j): moment(gx[i], gy[j], w) for i in range(2 * order + 1) for j in range(2 * order + 1 - i)}
    normal = np.stack(
        [np.stack([second[i + k, j + m] for k, m in terms], axis=-1) for i, j in terms], axis=-2
    )
    right = np.stack(
        [np.stack([moment(gx[i], gy[j], w * v) for i, j in terms], axis=-1) for v in value.T], axis=-1
    )
    far_weight = np.maximum(moment(far_x, far_y, w), 1e-12)  # no samples at all: direction 0
    far = np.stack([moment(far_x, far_y, w * v) / far_weight for v in value.T], axis=-1)
    # The far field enters as a weak observation of the value, zero as a weak one of the slopes.
    floor = max(_FAR_SHARE * float(np.median(w)), 1e-6) if len(w) else 1.0
    held = np.arange(len(terms))
    normal[..., held, held] += np.where(held > 0, _DAMPING[order], 0.0) * second[0, 0][..., None] + floor
    right[..., 0, :] += floor * far
    unit = np.broadcast_to(np.eye(len(terms), 1), (*right.shape[:-1], 1))
    solved = np.linalg.solve(normal, np.concatenate([right, unit], axis=-1))[..., 0, :]
    return solved[..., :2], solved[..., 2]


def _gaussian(d: Floats) -> Floats:
    """exp(-d^2 / 2), and zero where that is nothing: denormal numbers would slow the products tenfold."""
    return np.asarray(np.where(np.abs(d) < 9.0, np.exp(-0.5 * d**2), 0.0))
