"""The pin-hole camera: focal length, directions of vanishing points, plane to image (3.2.3, 3.2.4)."""

import math
from dataclasses import dataclass

import numpy as np

from services.arrays import Floats, Homography

FULL_FRAME_DIAGONAL_MM = 43.2666
"""Diagonal of the 36 x 24 mm frame that EXIF's 35 mm equivalent refers to."""

TYPICAL_FOCAL_LENGTH = 28.0 / FULL_FRAME_DIAGONAL_MM
"""Focal length over the image diagonal of a typical phone's main camera (26 to 30 mm equivalent)."""


@dataclass(frozen=True, slots=True)
class PrincipalPointPrior:
    """Prior on the principal point in centred coordinates, and the initial value of a fit.

    `deviations` (x, y) from the `mean` are standard deviations; a tiny one fixes the axis. With `half_size` (half the
    photo's width and height in the same units), the focal length is known as a multiple of the diagonal of the original
    photo, before it was cropped on one side of each axis.
    """

    deviations: tuple[float, float]
    start: tuple[float, float] = (0.0, 0.0)
    half_size: tuple[float, float] | None = None
    mean: tuple[float, float] = (0.0, 0.0)

    def log_growth(self, offset: Floats) -> tuple[float, Floats]:
        """Logarithm of the original over the present diagonal at an `offset` (2,), with its derivatives (2,)."""
        if self.half_size is None:
            return 0.0, np.zeros(2)
        half = np.array(self.half_size)
        grown = half + np.abs(offset)
        square = float(grown @ grown)
        return 0.5 * float(np.log(square / (half @ half))), np.sign(offset) * grown / square


def field_of_view(focal_length_px: float, width: int, height: int) -> float:
    """Diagonal field of view in radians of an image `width` x `height`."""
    return float(2 * np.arctan(0.5 * np.hypot(width, height) / focal_length_px))


def focal_length_from_vanishing_points(v_h: Floats, v_v: Floats) -> float | None:
    """f = sqrt(-v_h . v_v) for the vanishing points of two orthogonal directions (3.2.3).

    The points are homogeneous (3,), relative to the principal point. None if there is no solution:
    a point at infinity, or v_h . v_v > 0 (noise).
    """
    third = v_h[2] * v_v[2]
    if abs(third) < 1e-9:
        return None
    square = -(v_h[0] * v_v[0] + v_h[1] * v_v[1]) / third
    return float(np.sqrt(square)) if square > 0 else None


def rotation_from_vector(vector: Floats) -> Floats:
    """Rotation matrix (3, 3) of an axis-angle vector (3,), by Rodrigues' formula."""
    x, y, z = map(float, vector)
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = x / angle, y / angle, z / angle
    s, c = math.sin(angle), math.cos(angle)
    r = 1.0 - c
    return np.array(
        [
            [c + r * x * x, r * x * y - s * z, r * x * z + s * y],
            [r * x * y + s * z, c + r * y * y, r * y * z - s * x],
            [r * x * z - s * y, r * y * z + s * x, c + r * z * z],
        ]
    )


def rotation_from_flows(v_h: Floats, v_v: Floats, focal_length: float) -> Floats:
    """Rotation (3, 3) with columns V_h, V_v, N: the page's axes in the camera frame (Equation 3.1).

    With noise V_h and V_v are not exactly orthogonal; the nearest rotation distributes the error over both.
    The signs are chosen so that the page faces the camera (N_z > 0) and V_h points to the right.
    """
    V_h = v_h * np.array([1.0, 1.0, focal_length])
    V_v = v_v * np.array([1.0, 1.0, focal_length])
    V_h = V_h / np.linalg.norm(V_h)
    V_v = V_v / np.linalg.norm(V_v)
    V_h = V_h if V_h[0] >= 0 else -V_h
    if np.cross(V_h, V_v)[2] < 0:
        V_v = -V_v
    sum_, difference = V_h + V_v, V_h - V_v
    sum_, difference = sum_ / np.linalg.norm(sum_), difference / np.linalg.norm(difference)
    V_h, V_v = (sum_ + difference) / np.sqrt(2), (sum_ - difference) / np.sqrt(2)
    return np.stack([V_h, V_v, np.cross(V_h, V_v)], axis=1)


def plane_to_image(R: Floats, focal_length: float) -> Homography:
    """H_image_plane (3, 3) of a plane with axes R[:, 0], R[:, 1], through the point (0, 0, f) (Equation 3.4).

    Coordinates on both sides are relative to the principal point and in the same unit; the plane's
    unit is the image's at the principal point.
    """
    H = np.array(R, np.float64)
    H[:, 2] = 0.0, 0.0, focal_length
    H[:2] *= focal_length
    return np.asarray(H / focal_length)
