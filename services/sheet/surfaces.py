"""Descriptions of pages' surfaces for the answer, in photo pixels and the camera frame."""

from dataclasses import dataclass, replace
from typing import Self

from services.arrays import Floats
from services.geometry.homographies import resizing, to_resized

MAX_MAGNIFICATION_RATIO = 10.0
"""Largest over smallest enlargement over the text of a bent page; more is a wrong shape."""


@dataclass(frozen=True, slots=True)
class PlaneSurface:
    """Unit normal in the camera frame (x right, y down, z forward); None where f is unknown."""

    normal: tuple[float, float, float] | None

    def resized(self, _factor: float) -> Self:
        """The surface in pixels of a photo that is `factor` times as large."""
        return self


@dataclass(frozen=True, slots=True, eq=False)
class StripsSurface:
    """A developable page as planar strips between its rulings, in order across the page.

    `normals` (L, 3) are unit normals of the strips in the camera frame (z away from the viewer), `points`
    (L + 1, 2) a point of every ruling in photo pixels, `angles_rad` (L + 1,) its direction in [0, pi), and
    `vanishing_points` (L + 1, 3) its homogeneous vanishing point in photo pixels.
    """

    normals: Floats
    points: Floats
    angles_rad: Floats
    vanishing_points: Floats

    def resized(self, factor: float) -> Self:
        """See `PlaneSurface`."""
        vanishing_points = self.vanishing_points @ resizing(factor).T
        return replace(self, points=to_resized(self.points, factor), vanishing_points=vanishing_points)


@dataclass(frozen=True, slots=True, eq=False)
class MeshSurface:
    """A creased page as a mesh: `points` (rows, columns, 2) of its nodes in photo pixels, regular on the flat sheet.

    `normals` (rows - 1, columns - 1, 3) are the unit normals of its cells in the camera frame (z away from the viewer).
    """

    points: Floats
    normals: Floats

    def resized(self, factor: float) -> Self:
        """See `PlaneSurface`."""
        return replace(self, points=to_resized(self.points, factor))


Surface = PlaneSurface | StripsSurface | MeshSurface
