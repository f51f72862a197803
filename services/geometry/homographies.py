"""Homographies, named `H_dst_src`, on points (N, 2); many maps of the same points at once where a fit needs it."""

import numpy as np

from services.arrays import Floats, Homography, Points, Vector


def transform_points(H: Floats, points: Points) -> Floats:
    """Points (..., N, 2): `points` (N, 2) mapped by `H` (..., 3, 3); points on its vanishing line become infinite."""
    px, py = np.asarray(points, np.float64).T
    h = H[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        w = px * h[..., 2, 0, :] + py * h[..., 2, 1, :] + h[..., 2, 2, :]
        x = (px * h[..., 0, 0, :] + py * h[..., 0, 1, :] + h[..., 0, 2, :]) / w
        y = (px * h[..., 1, 0, :] + py * h[..., 1, 1, :] + h[..., 1, 2, :]) / w
    return np.stack([x, y], axis=-1)


def jacobians(H: Floats, points: Points) -> Floats:
    """Derivatives (..., N, 2, 2) of the maps `H` (..., 3, 3) at `points` (N, 2): d destination / d source."""
    p = np.asarray(points, np.float64)
    w = p[:, 0] * H[..., 2, 0, None] + p[:, 1] * H[..., 2, 1, None] + H[..., 2, 2, None]
    image = transform_points(H, p)
    upper = H[..., None, :2, :2] - image[..., None] * H[..., None, 2:, :2]
    return np.asarray(upper / w[..., None, None])


def directions(H: Floats, points: Points, ways: Points) -> tuple[Floats, Floats]:
    """x and y (..., N) of small `ways` (N, 2) at `points` (N, 2) under `H` (..., 3, 3), in any unit."""
    px, py = np.asarray(points, np.float64).T
    dx, dy = ways.T
    h = H[..., None]
    w = px * h[..., 2, 0, :] + py * h[..., 2, 1, :] + h[..., 2, 2, :]
    dw = dx * h[..., 2, 0, :] + dy * h[..., 2, 1, :]
    # The derivative of a quotient, times the square of w: the direction alone is asked for.
    found = []
    for row in (0, 1):
        x = px * h[..., row, 0, :] + py * h[..., row, 1, :] + h[..., row, 2, :]
        found.append((dx * h[..., row, 0, :] + dy * h[..., row, 1, :]) * w - x * dw)
    return found[0], found[1]


def translation(x: float, y: float) -> Homography:
    """Shift by (x, y)."""
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def scaling(s: float) -> Homography:
    """Enlargement by `s` about the origin."""
    return np.diag([s, s, 1.0])


def resizing(factor: float | Vector) -> Homography:
    """Homography from an image to the image resized by `factor`, or by one factor for each axis.

    Pixel centres map to (x + 0.5) factor - 0.5.
    """
    across, down = np.broadcast_to(factor, 2)
    return np.array([[across, 0.0, 0.5 * across - 0.5], [0.0, down, 0.5 * down - 0.5], [0.0, 0.0, 1.0]])


def to_resized(points: Floats, factor: float | Vector) -> Floats:
    """Pixels (..., 2) of an image as pixels of the image resized by `factor`, or by one factor for each axis."""
    return np.asarray((points + 0.5) * factor - 0.5)


def from_resized(points: Floats, factor: float | Vector) -> Floats:
    """Pixels (..., 2) of an image resized by `factor` as pixels of the image; inverse of `to_resized`."""
    return np.asarray((points + 0.5) / factor - 0.5)


def denominators(H: Homography, points: Points) -> Vector:
    """Third homogeneous coordinate (N,) of the mapped points; its sign is the side of the vanishing line."""
    return np.asarray(points @ H[2, :2] + H[2, 2])
