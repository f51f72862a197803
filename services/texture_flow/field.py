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
    samples: FlowSamples, shape: tuple[int, int], spacing_px: float, sigma_px: float
) -> FlowField:
    """Dense field over an image of `shape` (rows, columns) by local linear regression of the samples.

    At every node the doubled angles are fitted by a plane with Gaussian weights (sigma `sigma_px`) times
    the samples' own; a little of the far field keeps nodes without near samples defined (extrapolation).
    """
    rows = max(int(np.ceil(shape[0] / spacing_px)) + 1, 2)
    columns = max(int(np.ceil(shape[1] / spacing_px)) + 1, 2)
    axis_x, axis_y = np.arange(columns) * spacing_px, np.arange(rows) * spacing_px
    # The Gaussian separates: moments of the samples are gathered by two small matrix products.
    gx = np.exp(-0.5 * ((axis_x[:, None] - samples.points[:, 0]) / sigma_px) ** 2)
    gy = np.exp(-0.5 * ((axis_y[:, None] - samples.points[:, 1]) / sigma_px) ** 2)
    far_x = np.exp(-0.5 * ((axis_x[:, None] - samples.points[:, 0]) / (5 * sigma_px)) ** 2) + 1e-6
    far_y = np.exp(-0.5 * ((axis_y[:, None] - samples.points[:, 1]) / (5 * sigma_px)) ** 2) + 1e-6
    value = np.stack([np.cos(2 * samples.angles), np.sin(2 * samples.angles)], axis=1)
    dx = (axis_x[:, None] - samples.points[:, 0]) / sigma_px
    dy = (axis_y[:, None] - samples.points[:, 1]) / sigma_px
    w = samples.weights

    def moment(fx: Floats, fy: Floats, v: Vector) -> Floats:
        return np.asarray((fy * v) @ fx.T)

    near = [moment(gx, gy, w), moment(gx * dx, gy, w), moment(gx, gy * dy, w)]
    second = [moment(gx * dx * dx, gy, w), moment(gx * dx, gy * dy, w), moment(gx, gy * dy * dy, w)]
    normal = np.empty((rows, columns, 3, 3))
    normal[..., 0, 0], normal[..., 0, 1], normal[..., 0, 2] = near
    normal[..., 1, 1], normal[..., 1, 2], normal[..., 2, 2] = second
    normal[..., 1, 0], normal[..., 2, 0], normal[..., 2, 1] = near[1], near[2], second[1]
    far_weight = np.maximum(moment(far_x, far_y, w), 1e-12)  # no samples at all: direction 0
    far = np.stack([moment(far_x, far_y, w * value[:, k]) / far_weight for k in (0, 1)], axis=-1)
    right = np.stack(
        [
            np.stack([moment(gx, gy, w * v), moment(gx * dx, gy, w * v), moment(gx, gy * dy, w * v)], axis=-1)
            for v in value.T
        ],
        axis=-1,
    )
    # The far field enters as a weak observation of the value, zero as a weak one of the slopes.
    floor = 0.02 * float(np.median(w)) if len(w) else 1.0
    normal[..., 0, 0] += floor
    right[..., 0, :] += floor * far
    normal[..., 1, 1] += 0.03 * near[0] + floor
    normal[..., 2, 2] += 0.03 * near[0] + floor
    doubled = np.linalg.solve(normal, right)[..., 0, :]
    return FlowField(doubled, (0.0, 0.0), spacing_px)


def reject_outliers(
    samples: FlowSamples, sigma_px: float, shape: tuple[int, int], limit_rad: float
) -> FlowSamples:
    """Coherence check (2.3.2): drop samples that differ from the average of their neighbours by more.

    The limit tightens to 4 robust standard deviations where the samples agree better than `limit_rad`.
    """
    for _ in range(2):
        field = smooth_samples(samples, shape, sigma_px / 1.5, sigma_px)
        deviation = np.abs(angle_difference(samples.angles, field.at(samples.points)))
        spread = 1.4826 * float(np.median(deviation)) if len(samples) else 0.0
        limit = float(np.clip(4 * spread, limit_rad / 10, limit_rad))
        samples = samples.select(deviation <= limit)
    return samples


def resize_field(field: FlowField, factor: float) -> FlowField:
    """The same field in the frame of the image enlarged by `factor` (see conventions: pixel centres)."""
    shift = 0.5 * factor - 0.5
    origin = (field.origin[0] * factor + shift, field.origin[1] * factor + shift)
    return FlowField(field.doubled, origin, field.spacing_px * factor)
