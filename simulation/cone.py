"""A circular cone: the simplest developable whose rulings are not parallel."""

from dataclasses import dataclass

import numpy as np

from simulation.flat_page import Points
from simulation.surfaces import Points3


@dataclass(frozen=True, slots=True)
class Cone:
    """The sheet rolled on a circular cone.

    `apex` (s, t) is where all rulings of the sheet meet, in half page widths from the sheet's centre, and
    must lie outside of the sheet. `half_angle_rad` is between axis and ruling: the smaller, the tighter
    the roll. The ruling through the centre stays where it was in the plane. `bulge` is +1 for a sheet that
    comes towards the viewer there, -1 for one that hollows away.
    """

    apex: tuple[float, float]
    half_angle_rad: float
    bulge: int = 1

    def __post_init__(self) -> None:
        if not 0 < self.half_angle_rad < np.pi / 2 or self.bulge not in (-1, 1) or self.apex == (0.0, 0.0):
            raise ValueError("a cone needs an apex off the centre, 0 < half angle < pi/2, and a bulge of +-1")

    def place(self, sheet: Points) -> Points3:
        """See `Shape`: polar (rho, phi) about the apex -> the ruling at azimuth phi / sin(half angle)."""
        rho, azimuth = self._polar(sheet)
        apex = np.array([*self.apex, 0.0])
        return apex + rho[:, None] * self._ruling_at(azimuth)

    def tangents(self, sheet: Points) -> tuple[Points3, Points3]:
        """See `Shape`: the polar frame of the sheet, carried over and turned back to its axes."""
        along, across, phi = self._polar_frame(sheet)
        c, s = np.cos(phi)[:, None], np.sin(phi)[:, None]
        return c * along - s * across, s * along + c * across

    def rulings(self, sheet: Points) -> Points3:
        """See `Shape`."""
        along, _, phi = self._polar_frame(sheet)
        return np.where(np.sin(phi)[:, None] < 0, -along, along)

    def meet(self, origin: Points3, directions: Points3) -> Points:
        """See `Shape`: the quadratic of ray and cone; the root on the front side of the right nappe."""
        frame = self._frame()
        start = frame @ (origin - np.array([*self.apex, 0.0]))
        rays = directions @ frame.T
        k = np.tan(self.half_angle_rad) ** 2
        a = rays[:, 0] ** 2 + rays[:, 1] ** 2 - k * rays[:, 2] ** 2
        b = 2 * (start[0] * rays[:, 0] + start[1] * rays[:, 1] - k * start[2] * rays[:, 2])
        c = start[0] ** 2 + start[1] ** 2 - k * start[2] ** 2
        met = np.full((len(rays), 2), np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            # The stable pair of roots: q / a and c / q lose no digits when a is small.
            q = -0.5 * (b + np.where(b < 0, -1.0, 1.0) * np.sqrt(b**2 - 4 * a * c))
            for reach in (q / a, c / q):
                at = start + reach[:, None] * rays
                azimuth = np.arctan2(at[:, 1], at[:, 0])
                normal = self.bulge * self._inward_normal(azimuth)
                good = (reach > 0) & (at[:, 2] > 0)
                good &= np.einsum("ij,ij->i", normal, rays) > 0
                phi = azimuth * np.sin(self.half_angle_rad) * self.bulge + self._reference_angle()
                rho = np.linalg.norm(at, axis=1)
                found = np.column_stack([rho * np.cos(phi), rho * np.sin(phi)]) + np.array(self.apex)
                met[good] = found[good]
        return met

    def _reference_angle(self) -> float:
        return float(np.arctan2(-self.apex[1], -self.apex[0]))

    def _polar(self, sheet: Points) -> tuple[Points, Points]:
        """Distance from the apex, and azimuth round the cone's axis (0 on the ruling of the centre)."""
        offset = sheet - np.array(self.apex)
        phi = np.arctan2(offset[:, 1], offset[:, 0]) - self._reference_angle()
        phi = (phi + np.pi) % (2 * np.pi) - np.pi
        return np.hypot(offset[:, 0], offset[:, 1]), self.bulge * phi / np.sin(self.half_angle_rad)

    def _frame(self) -> Points3:
        """Rotation (3, 3) surface frame -> cone frame (axis on z, centre's ruling in the x-z half plane)."""
        angle = self._reference_angle()
        ruling = np.array([np.cos(angle), np.sin(angle), 0.0])
        inward = np.array([0.0, 0.0, float(self.bulge)])
        # Beside the tangents: inward normal = ruling x across in the cone's frame.
        across = np.cross(inward, ruling)
        sin, cos = np.sin(self.half_angle_rad), np.cos(self.half_angle_rad)
        in_cone = np.array([[sin, 0.0, cos], [0.0, 1.0, 0.0], [-cos, 0.0, sin]])
        in_surface = np.stack([ruling, across, inward])
        frame: Points3 = in_cone.T @ in_surface
        return frame

    def _ruling_at(self, azimuth: Points) -> Points3:
        sin, cos = np.sin(self.half_angle_rad), np.cos(self.half_angle_rad)
        in_cone = np.column_stack([sin * np.cos(azimuth), sin * np.sin(azimuth), np.full(len(azimuth), cos)])
        return in_cone @ self._frame()

    def _inward_normal(self, azimuth: Points) -> Points3:
        """In the cone's frame."""
        sin, cos = np.sin(self.half_angle_rad), np.cos(self.half_angle_rad)
        return np.column_stack([-cos * np.cos(azimuth), -cos * np.sin(azimuth), np.full(len(azimuth), sin)])

    def _polar_frame(self, sheet: Points) -> tuple[Points3, Points3, Points]:
        """Unit vectors along the ruling and across it (growing phi), and phi itself from the s axis."""
        _, azimuth = self._polar(sheet)
        along = self._ruling_at(azimuth)
        in_cone = np.column_stack([-np.sin(azimuth), np.cos(azimuth), np.zeros(len(azimuth))])
        across = self.bulge * (in_cone @ self._frame())
        offset = sheet - np.array(self.apex)
        return along, across, np.arctan2(offset[:, 1], offset[:, 0])
