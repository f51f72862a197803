"""Where the page is held, and the pin-hole that looks at it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simulation.flat_page import Points
from simulation.surfaces import Points3


@dataclass(frozen=True, slots=True)
class Pose:
    """Three angles and a translation: surface frame -> camera frame (x right, y down, z forward).

    The page leans away by `tilt_rad` in the direction `azimuth_rad` of its own plane (0: its right side
    is the far one; pi/2: its foot), and is then rolled by `roll_rad` round the optical axis (clockwise as
    displayed). `translation` is in half page widths; its third part is the distance of the page's centre.
    """

    tilt_rad: float = 0.0
    azimuth_rad: float = 0.0
    roll_rad: float = 0.0
    translation: tuple[float, float, float] = (0.0, 0.0, 3.0)

    def rotation(self) -> NDArray[np.float64]:
        """Rotation matrix (3, 3), surface -> camera."""
        leaning: NDArray[np.float64] = _lean(self.tilt_rad) @ _about_z(-self.azimuth_rad)
        return _about_z(self.roll_rad + self.azimuth_rad) @ leaning

    def to_camera(self, points: Points3) -> Points3:
        """Surface points (N, 3) -> camera frame."""
        placed: Points3 = points @ self.rotation().T + np.array(self.translation)
        return placed

    def eye(self) -> Points3:
        """The optical centre (3,) in the surface frame."""
        eye: Points3 = -self.rotation().T @ np.array(self.translation)
        return eye


@dataclass(frozen=True, slots=True)
class Camera:
    """A pin-hole with square pixels, its principal point in the middle of the image, or `offset_px` beside it."""

    focal_length_px: float
    width: int
    height: int
    offset_px: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if self.focal_length_px <= 0 or self.width < 2 or self.height < 2:
            raise ValueError("a camera needs a positive focal length and at least 2x2 pixels")

    @property
    def principal_point(self) -> Points:
        """(2,) px."""
        x, y = self.offset_px
        return np.array([(self.width - 1) / 2.0 + x, (self.height - 1) / 2.0 + y])

    @property
    def half_field_of_view_rad(self) -> float:
        """Angle between the optical axis and the ray to an image corner (3.4.1), were the axis in the middle."""
        return half_field_of_view(self.focal_length_px, self.width, self.height)

    def project(self, points: Points3) -> Points:
        """Camera-frame points (N, 3) -> photo pixels; NaN for points at or behind the camera."""
        depth = np.where(points[:, 2] > 1e-9, points[:, 2], np.nan)
        return self.focal_length_px * points[:, :2] / depth[:, None] + self.principal_point

    def rays(self, points: Points) -> Points3:
        """Photo pixels -> viewing rays (p, q, f) (N, 3), centred, not unit."""
        return np.column_stack([points - self.principal_point, np.full(len(points), self.focal_length_px)])

    def project_directions(self, points: Points, directions: Points3) -> Points:
        """Images (N, 2) of 3D directions at photo points, by (A.1): (0, 0, 1) x (T x (p, q, f))."""
        return np.cross([0.0, 0.0, 1.0], np.cross(directions, self.rays(points)))[:, :2]


def half_field_of_view(focal_length_px: float, width: int, height: int) -> float:
    """Angle (rad) at the optical centre between the axis and an image corner (3.4.1)."""
    return float(np.arctan2(np.hypot((width - 1) / 2.0, (height - 1) / 2.0), focal_length_px))


def _about_z(angle_rad: float) -> NDArray[np.float64]:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _lean(tilt_rad: float) -> NDArray[np.float64]:
    """Rotation round y that takes x to (cos, 0, sin): the right side goes away."""
    c, s = np.cos(tilt_rad), np.sin(tilt_rad)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
