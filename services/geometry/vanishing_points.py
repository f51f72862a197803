"""Robust estimation of vanishing points from direction samples (dissertation 3.2.2, 3.2.3)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector
from services.robust import cauchy_weights, robust_scale


@dataclass(frozen=True, slots=True, eq=False)
class VanishingPoint:
    """A vanishing point, and how exactly the samples converge there.

    `direction` (3,) is the unit homogeneous point in centred, scaled coordinates (x / unit, y / unit, 1);
    a zero third coordinate is a point at infinity. `convergence` is S3/S1 of the inliers' tangent lines (3.2.2),
    `residual_rad` the weighted RMS angle between samples and the point, `inliers` (N,) the samples kept.
    """

    direction: Floats
    convergence: float
    residual_rad: float
    inliers: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class FlowVanishingPoints:
    """Vanishing points of major and minor flow (centred unit coordinates)."""

    horizontal: VanishingPoint
    vertical: VanishingPoint


def tangent_lines(points: Points, angles: Vector) -> Floats:
    """Flow tangent lines l_i = (x_i, y_i, 1) x (cos a_i, sin a_i, 0), as rows (N, 3) (3.2.2)."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([-s, c, points[:, 0] * s - points[:, 1] * c], axis=1)


def convergence_quality(lines: Floats, weights: Vector) -> float:
    """S3/S1 of L = (l_1 ... l_N): zero when all lines meet in one point."""
    singular = np.linalg.svd(lines * np.sqrt(weights / weights.sum())[:, None], compute_uv=False)
    return float(singular[2] / singular[0]) if singular[0] > 0 else 0.0


def angular_residuals(direction: Floats, points: Points, angles: Vector) -> Vector:
    """Signed sine of the angle (N,) between each sample and the direction from its point to the vanishing point."""
    dx = direction[0] - points[:, 0] * direction[2]
    dy = direction[1] - points[:, 1] * direction[2]
    length = np.maximum(np.hypot(dx, dy), 1e-12)
    return np.asarray((np.cos(angles) * dy - np.sin(angles) * dx) / length)


def estimate_vanishing_point(
    points: Points, angles: Vector, weights: Vector, iterations: int = 12, floor_rad: float = 1e-3
) -> VanishingPoint:
    """Vanishing point of samples at `points` (N, 2), centred and scaled to about unit size.

    The initial value is the point at infinity in the mean direction. It tolerates 30 % of random directions. Algebraic
    least squares over all lines would instead be biased to the middle of the photo, because every line passes near it.
    Then the angles are minimised by reweighting: each line is divided by its distance to the point (Sampson's weight),
    and outliers get the weights of a Cauchy loss, whose scale follows the residuals (never below `floor_rad`).
    """
    lines = tangent_lines(points, angles)
    w = weights / max(float(weights.sum()), 1e-12)
    mean = 0.5 * np.arctan2(w @ np.sin(2 * angles), w @ np.cos(2 * angles))
    v = np.array([np.cos(mean), np.sin(mean), 0.0])
    scale = floor_rad
    for _ in range(iterations):
        distance = np.maximum(np.hypot(v[0] - points[:, 0] * v[2], v[1] - points[:, 1] * v[2]), 1e-9)
        r = (lines @ v) / distance
        scale = max(robust_scale(r), floor_rad)
        robust = w * cauchy_weights(r, 2.0 * scale)
        v = np.linalg.svd(lines * (np.sqrt(robust) / distance)[:, None], full_matrices=False)[2][2]
    r = angular_residuals(v, points, angles)
    inliers = np.abs(r) < 4 * scale
    kept = w * inliers
    residual = float(np.sqrt(np.sum(kept * r**2) / max(float(kept.sum()), 1e-12)))
    return VanishingPoint(v, convergence_quality(lines[inliers], weights[inliers]), residual, inliers)
