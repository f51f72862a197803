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

import cv2
import numpy as np

from services.arrays import Floats, Points, Vector

Directions = Callable[[Points], Vector]
"""Directions (N,) rad of a flow at points (N, 2), in centred unit coordinates."""


@dataclass(frozen=True, slots=True, eq=False)
class TextDensity:
    """How much text there is: `values` (rows, columns) 0-1, node (r, c) at `origin` + `spacing` (c, r)."""

    values: Floats
    origin: Points
    spacing: float

    def at(self, points: Points) -> Floats:
        """Density (...) at `points` (..., 2), zero outside."""
        where = ((points - self.origin) / self.spacing).astype(np.float32).reshape(-1, 2)
        # OpenCV looks up in an image: the list of points is folded into rows that it can take.
        width = min(max(len(where), 1), 4096)
        folded = np.pad(where, ((0, -len(where) % width), (0, 0))).reshape(-1, width, 2)
        value = cv2.remap(
            self.values.astype(np.float32),
            folded[..., 0],
            folded[..., 1],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
        )
        return np.asarray(value.ravel()[: len(where)].reshape(points.shape[:-1]), np.float64)


def measure_text_density(points: Points, spacing: float) -> TextDensity:
    """Density of marks at `points` (N, 2), one where they are half as dense as is typical, or denser."""
    low = points.min(axis=0) - 3 * spacing
    cells = np.minimum(np.ceil((np.ptp(points, axis=0) + 6 * spacing) / spacing), 256).astype(int) + 1
    at = np.clip(np.round((points - low) / spacing).astype(int), 0, cells - 1)
    count = np.zeros((cells[1], cells[0]))
    np.add.at(count, (at[:, 1], at[:, 0]), 1.0)
    count = cv2.GaussianBlur(count, (0, 0), 1.0, borderType=cv2.BORDER_CONSTANT)
    typical = float(np.median(count[at[:, 1], at[:, 0]]))
    return TextDensity(np.clip(2 * count / max(typical, 1e-12), 0.0, 1.0), low, spacing)


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
    flow: Directions, density: TextDensity, points: Points, angles: Floats, places: Vector
) -> Convergence:
    """Convergence of `flow` along the lines through `points` (N, 2) at `angles` (N, J), sampled at `places` (M,).

    All lengths are in unit coordinates; places are signed distances from the point.
    """
    along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    where = points[:, None, None, :] + along[:, :, None, :] * places[:, None]
    alpha = flow(where.reshape(-1, 2)).reshape(where.shape[:-1]) - angles[..., None]
    w = np.where(np.isfinite(alpha), density.at(where), 0.0)
    alpha = np.where(np.isfinite(alpha), alpha, 0.0)
    s, c = np.sin(alpha), np.cos(alpha)
    w_line, w_cot, w_square = w * s**4, w * s**3 * c, w * (s * c) ** 2
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
