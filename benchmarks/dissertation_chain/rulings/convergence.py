"""Convergence of a flow along straight lines of the photo, for many lines at once (dissertation 3.3.3).

Along a projected ruling the tangent plane is one and the same, so the tangent lines of the flow meet in a point
V. Let x be the place on the line and alpha(x) the angle from the line to the flow there; with V = (V_u, V_w) in
the line's own axes, meeting means

    cot alpha(x) = (V_u - x) / V_w = a + b x,

a straight line in x. An error of the angle moves the cotangent by its 1 / sin^2 alpha-fold; weighted so, the
residual of a linear regression is an angle in radians whatever the line's direction, which S3/S1 of the tangent
lines is not, and its moments are plain sums.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from services.arrays import Floats, Points, Vector

Directions = Callable[[Points], Vector]
"""Directions (N,) rad of a flow at points (N, 2), in centred unit coordinates."""


Weights = Callable[[Points], Vector]
"""Weights (M,) at points (M, 2), in centred unit coordinates."""


@dataclass(frozen=True, slots=True, eq=False)
class Convergence:
    """How well a flow converges along lines; arrays have the lines' shape (...).

    `mean_square` rad^2 is the weighted mean square angle between the flow and the best point; `a`, `b` place that
    point (see the module); `inverse` (..., 2, 2) is the inverse normal matrix of (a, b): times the variance of the
    flow, their covariance, were every unit of weight one independent measurement; `weight` (...) sums the weights,
    times the distance of samples: the length of text that the line crosses.
    """

    mean_square: Floats
    a: Floats
    b: Floats
    inverse: Floats
    weight: Floats


def measure_convergence(
    flow: Directions, weight_at: Weights, points: Points, angles: Floats, places: Vector
) -> Convergence:
    """Convergence of `flow` along the lines through `points` (N, 2) at `angles` (N, J), sampled at `places` (M,).

    All lengths are in unit coordinates; places are signed distances from the point.
    """
    along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    where = points[:, None, None, :] + along[:, :, None, :] * places[:, None]
    alpha = flow(where.reshape(-1, 2)).reshape(where.shape[:-1]) - angles[..., None]
    w = np.where(np.isfinite(alpha), weight_at(where.reshape(-1, 2)).reshape(where.shape[:-1]), 0.0)
    alpha = np.where(np.isfinite(alpha), alpha, 0.0)
    s, c = np.sin(alpha), np.cos(alpha)
    w_sine = w * s * s
    w_line, w_cot, w_square = w_sine * s * s, w_sine * s * c, w_sine * c * c
    total = w.sum(axis=-1)
    m0, m1, m2 = w_line.sum(axis=-1), w_line @ places, w_line @ places**2
    t0, t1, q = w_cot.sum(axis=-1), w_cot @ places, w_square.sum(axis=-1)
    # A hair of a prior (a = b = 0) keeps lines that cross no text, or run along the flow, defined.
    hair = 1e-10 * np.maximum(total, 1.0)
    m0, m2 = m0 + hair, m2 + hair
    determinant = m0 * m2 - m1**2
    inverse = np.stack([m2, -m1, -m1, m0], axis=-1).reshape(*m0.shape, 2, 2) / determinant[..., None, None]
    a = (m2 * t0 - m1 * t1) / determinant
    b = (m0 * t1 - m1 * t0) / determinant
    residual = np.maximum(q - a * t0 - b * t1, 0.0)
    step = float(places[1] - places[0])
    return Convergence(residual / np.maximum(total, 1e-9), a, b, inverse / step, total * step)
