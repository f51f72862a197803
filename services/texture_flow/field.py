"""Samples of an orientation field, and the dense field that interpolates them."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector

_REMAP_WIDTH = 4096
"""Points are looked up as an image of this width: OpenCV's bilinear look-up is ten times numpy's."""


def angle_difference(a: Vector, b: Vector | float) -> Vector:
    """Signed difference a - b of two directions modulo pi, in [-pi/2, pi/2)."""
    return np.asarray((a - b + np.pi / 2) % np.pi - np.pi / 2)


@dataclass(frozen=True, slots=True, eq=False)
class FlowSamples:
    """Directions measured at points: `points` (N, 2) px, `angles` (N,) rad modulo pi, `weights` (N,) 0-1."""

    points: Points
    angles: Vector
    weights: Vector

    def __len__(self) -> int:
        return len(self.angles)

    def select(self, chosen: NDArray[np.bool_]) -> "FlowSamples":
        """The samples where `chosen` (N,) is true."""
        return FlowSamples(self.points[chosen], self.angles[chosen], self.weights[chosen])


@dataclass(frozen=True, slots=True, eq=False)
class FlowField:
    """Dense orientation field on a regular grid, extrapolated to every pixel.

    `doubled` (rows, columns, 2) holds (cos 2a, sin 2a); node (r, c) lies at `origin` + `spacing_px` (c, r).
    """

    doubled: Floats
    origin: tuple[float, float]
    spacing_px: float

    def at(self, points: Points) -> Vector:
        """Direction at `points` (N, 2), rad in [-pi/2, pi/2), bilinear between nodes, constant beyond them."""
        count = len(points)
        if count == 0:
            return np.zeros(0)
        where = ((np.asarray(points) - self.origin) / self.spacing_px).astype(np.float32)
        width = min(count, _REMAP_WIDTH)
        where = np.pad(where, ((0, -count % width), (0, 0)), mode="edge").reshape(-1, width, 2)
        grid = self.doubled.astype(np.float32)
        value = cv2.remap(
            grid, where[..., 0], where[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        ).reshape(-1, 2)[:count]
        return np.asarray(0.5 * np.arctan2(value[:, 1], value[:, 0]), np.float64)


def smooth_samples(
    samples: FlowSamples, shape: tuple[int, int], spacing_px: float, sigma_px: float, order: int = 1
) -> FlowField:
    """Dense field over an image of `shape` (rows, columns) by local polynomial regression of the samples.

    At every node the doubled angles are fitted by a plane (`order` 1) or a quadric (2: follows a bent page, and is
    rougher) with Gaussian weights (sigma `sigma_px`) times the samples' own; a little of the far field keeps nodes
    without near samples defined (extrapolation).
    """
    rows = max(int(np.ceil(shape[0] / spacing_px)) + 1, 2)
    columns = max(int(np.ceil(shape[1] / spacing_px)) + 1, 2)
    axis_x, axis_y = np.arange(columns) * spacing_px, np.arange(rows) * spacing_px
    # The Gaussian separates: moments of the samples are gathered by small matrix products.
    dx = (axis_x[:, None] - samples.points[:, 0]) / sigma_px
    dy = (axis_y[:, None] - samples.points[:, 1]) / sigma_px
    gx, gy = np.exp(-0.5 * dx**2), np.exp(-0.5 * dy**2)
    far_x, far_y = np.exp(-0.5 * (dx / 5) ** 2) + 1e-6, np.exp(-0.5 * (dy / 5) ** 2) + 1e-6
    value = np.stack([np.cos(2 * samples.angles), np.sin(2 * samples.angles)], axis=1)
    w = samples.weights

    def moment(fx: Floats, fy: Floats, v: Vector) -> Floats:
        return np.asarray((fy * v) @ fx.T)

    terms = [(i, j) for total in range(order + 1) for i in range(total, -1, -1) for j in [total - i]]
    powers_x = [gx * dx**i for i in range(2 * order + 1)]
    powers_y = [gy * dy**j for j in range(2 * order + 1)]
    second = {
        (i, j): moment(powers_x[i], powers_y[j], w)
        for i in range(2 * order + 1)
        for j in range(2 * order + 1 - i)
    }
    normal = np.empty((rows, columns, len(terms), len(terms)))
    for m, (i, j) in enumerate(terms):
        for n, (k, q) in enumerate(terms):
            normal[..., m, n] = second[i + k, j + q]
    right = np.stack(
        [np.stack([moment(powers_x[i], powers_y[j], w * v) for i, j in terms], axis=-1) for v in value.T],
        axis=-1,
    )
    far_weight = np.maximum(moment(far_x, far_y, w), 1e-12)  # no samples at all: direction 0
    far = np.stack([moment(far_x, far_y, w * value[:, k]) / far_weight for k in (0, 1)], axis=-1)
    # The far field enters as a weak observation of the value, zero as a weak one of the slopes.
    floor = 0.002 * float(np.median(w)) if len(w) else 1.0
    normal[..., 0, 0] += floor
    right[..., 0, :] += floor * far
    damping = {1: 0.03, 2: 0.001}[order]
    for m in range(1, len(terms)):
        normal[..., m, m] += damping * second[0, 0] + floor
    doubled = np.linalg.solve(normal, right)[..., 0, :]
    return FlowField(doubled, (0.0, 0.0), spacing_px)


def reject_outliers(
    samples: FlowSamples, sigma_px: float, shape: tuple[int, int], limit_rad: float, order: int = 1
) -> FlowSamples:
    """Coherence check (2.3.2): drop samples that differ from the average of their neighbours by more.

    The limit tightens to 5 robust standard deviations where the samples agree better than `limit_rad`.
    """
    for _ in range(2):
        field = smooth_samples(samples, shape, sigma_px / 1.5, sigma_px, order)
        deviation = np.abs(angle_difference(samples.angles, field.at(samples.points)))
        spread = 1.4826 * float(np.median(deviation)) if len(samples) else 0.0
        limit = float(np.clip(5 * spread, limit_rad / 8, limit_rad))
        samples = samples.select(deviation <= limit)
    return samples


def resize_field(field: FlowField, factor: float) -> FlowField:
    """The same field in the frame of the image enlarged by `factor` (see conventions: pixel centres)."""
    shift = 0.5 * factor - 0.5
    origin = (field.origin[0] * factor + shift, field.origin[1] * factor + shift)
    return FlowField(field.doubled, origin, field.spacing_px * factor)
