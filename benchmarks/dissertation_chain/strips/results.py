"""The shape of a page in strips, and the evidence for it."""

from dataclasses import dataclass

from services.arrays import Floats, Points, Vector


@dataclass(frozen=True, slots=True, eq=False)
class StripShape:
    """L planar strips between L + 1 rulings, left to right along the text, in centred unit coordinates.

    `normals` (L, 3) are unit normals away from the viewer, `focal` the focal length over half the diagonal, both as
    optimized; `initial_normals` and `initial_focal` what the search found. `objective` is its value after
    `evaluations`, `converged` whether these sufficed. `reference_points` (L + 1, 2) lie on the rulings with
    `ruling_angles` (L + 1,) rad in [0, pi) and homogeneous `vanishing_points` (L + 1, 3), as they follow from the
    normals; `reference_points_3d` (L + 1, 3) are the same in space, in the camera frame, the first at depth `focal`.
    """

    normals: Floats
    focal: float
    initial_normals: Floats
    initial_focal: float
    objective: float
    evaluations: int
    converged: bool
    reference_points: Points
    ruling_angles: Vector
    vanishing_points: Floats
    reference_points_3d: Floats
