"""Other photos of a creased sheet: their cameras, and residuals of the points that they share with the first photo.

A point x of the first photo shows the sheet's point X = Z (x / f, 1) on its ray. Another camera sees it at
f' (Y_1, Y_2) / Y_3 with Y = R X + t. If the nodes move by dX_k, the ray meets the sheet at another depth:
dX = r (n . sum_k w_k dX_k) / (n . r), with the ray's direction r = X and the sheet's normal n there.
"""

from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Floats, Points, Vector
from services.geometry.camera import rotation_from_vector
from services.sheet.ridged.blocks import ResidualBlock, SparseRows
from services.sheet.ridged.mesh import PlacedPoints, SheetMesh

CAMERA_UNKNOWNS = 7
"""Of a camera: turn (axis times angle, rad, against its start), translation, logarithm of the focal length."""


@dataclass(frozen=True, slots=True, eq=False)
class OtherCamera:
    """A camera that sees X, in the frame of the first one, at `focal` (Y_1, Y_2) / Y_3, Y = rotation X + translation.

    Lengths and photo points are in the centred unit coordinates of either photo.
    """

    rotation: Floats
    translation: Vector
    focal: float

    def project(self, X: Floats) -> Points:
        """Photo points (N, 2) of points in space (N, 3)."""
        Y = X @ self.rotation.T + self.translation
        return np.asarray(self.focal * Y[:, :2] / np.maximum(Y[:, 2:], 1e-9))

    def derivatives(self, X: Floats, turn: Vector) -> tuple[Points, Floats]:
        """Photo points (N, 2) of points in space, and their derivatives (N, 2, 7) by the unknowns of the camera that
        came here by a small `turn` (3,).
        """
        turned = X @ self.rotation.T
        Y = turned + self.translation
        depth = np.maximum(Y[:, 2], 1e-9)
        seen = self.focal * Y[:, :2] / depth[:, None]
        # By Y.
        P = np.zeros((len(X), 2, 3))
        P[:, 0, 0] = P[:, 1, 1] = self.focal
        P[:, :, 2] = -seen
        P /= depth[:, None, None]
        K = np.array([[0, -turn[2], turn[1]], [turn[2], 0, -turn[0]], [-turn[1], turn[0], 0]])
        by_turn = np.cross(turned[:, None, :], P) @ (np.eye(3) + 0.5 * K)
        return seen, np.concatenate([by_turn, P, seen[:, :, None]], axis=2)

    def moved(self, change: Vector) -> "OtherCamera":
        """The camera after a `change` (7,) of its unknowns, the last of which is the logarithm itself."""
        turn = rotation_from_vector(change[:3])
        return OtherCamera(turn @ self.rotation, self.translation + change[3:6], float(np.exp(change[6])))

    def see(self, mesh: SheetMesh) -> SheetMesh:
        """The sheet as this camera sees it, in its own frame."""
        return replace(mesh, nodes=mesh.nodes @ self.rotation.T + self.translation, focal=self.focal)


@dataclass(frozen=True, slots=True, eq=False)
class OtherView:
    """Points (N, 2) of the first photo that another one shows at `seen` (N, 2), centred, and its camera.

    `deviation` is that of a coordinate of `seen`; `log_focal` and `focal_deviation` are known of the camera beforehand.
    """

    points: Points
    seen: Points
    deviation: float
    camera: OtherCamera
    log_focal: float
    focal_deviation: float

    @property
    def start(self) -> Vector:
        """Unknowns (7,) of the camera at its start."""
        return np.array([0.0] * 3 + [0.0] * 3 + [np.log(self.camera.focal)])


def view_residuals(
    view: OtherView, change: Vector, placed: PlacedPoints, focal_at: int, camera_at: int
) -> ResidualBlock:
    """Distances, in deviations, of the sheet's points from where the other photo shows them.

    `placed` are the points of the sheet that the first camera sees at `view.points`; the unknowns of its focal
    length and of the other camera begin at `focal_at` and `camera_at`.
    """
    camera, count = view.camera.moved(change), len(view.points)
    X = placed.X
    normal = np.cross(placed.X_c, placed.X_r)
    sight = np.einsum("ni,ni->n", normal, X)
    sight = np.where(np.abs(sight) < 1e-12, 1e-12, sight)
    seen, by_camera = camera.derivatives(X, change[:3])
    P, turned = by_camera[:, :, 3:6], X @ camera.rotation.T
    along = np.einsum("nij,nj->ni", P, turned)  # by the relative depth of the sheet's point on its ray
    by_node = along[:, :, None] * (normal / sight[:, None])[:, None, :]
    entries = (placed.weights[:, None, :, None] * by_node[:, :, None, :]).reshape(count, 2, 12)
    # A longer first focal length draws the ray to the axis, and the sheet is met at another depth.
    inward = np.column_stack([-X[:, :2], np.zeros(count)])
    met = -np.einsum("ni,ni->n", normal, inward) / sight
    by_focal = np.einsum("nij,nj->ni", P, inward @ camera.rotation.T) + along * met[:, None]
    columns = np.concatenate(
        [
            (3 * placed.nodes[:, :, None] + np.arange(3)).reshape(count, 12),
            np.full((count, 1), focal_at),
            np.tile(camera_at + np.arange(CAMERA_UNKNOWNS), (count, 1)),
        ],
        axis=1,
    )
    rows = np.concatenate([entries, by_focal[:, :, None], by_camera], axis=2)
    values = ((seen - view.seen) / view.deviation).ravel()
    return ResidualBlock(
        values, SparseRows(np.repeat(columns, 2, axis=0), rows.reshape(2 * count, -1) / view.deviation), 1
    )
