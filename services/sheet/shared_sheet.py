"""One bent sheet that several photos show parts of: its shape, and the cameras before it.

The sheet has a frame of its own: the text's axes and the normal at its origin. A camera sees a point X of it at
f (Y_1, Y_2) / Y_3 with Y = R X + t. Seen by one camera, in the units in which the origin's depth t_3 is its focal
length f, it is a `DevelopableSurface` with the origin at f (t_1, t_2) / t_3; a unit there is t_3 / f of the sheet's.
"""

from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Floats, Points, Vector
from services.geometry.camera import rotation_from_vector
from services.sheet.developable.surface import BendBasis, DevelopableSurface
from services.sheet.ridged.views import CAMERA_UNKNOWNS, OtherCamera

OF_SKEW, OF_SLOPES, OF_SLANT, OF_BENDS = 0, slice(1, 3), 3, 4
"""Places among the unknowns of the shape; those of the cameras follow it."""
PROBE = 1e-5
"""Step of a difference."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldCamera:
    """A camera by what it sees of the page point `held` (u, v), which lies in its photo.

    `rotation` (3, 3) has the text's axes and the sheet's normal there as columns, in the camera's frame; the point is
    seen at `anchor`, at a depth of `unit` times the focal length. So a change of the sheet's shape far from the photo
    changes nothing in it, and one of the focal length nothing at this point.
    """

    held: tuple[float, float]
    rotation: Floats
    anchor: Vector
    unit: float
    focal: float

    @property
    def place(self) -> Vector:
        """The held point in the camera's frame."""
        return self.unit * np.append(self.anchor, self.focal)

    def moved(self, change: Vector) -> "HeldCamera":
        """The camera after a `change` (7,): turn, anchor, logarithms of unit and focal length."""
        return replace(
            self,
            rotation=rotation_from_vector(change[:3]) @ self.rotation,
            anchor=self.anchor + change[3:5],
            unit=self.unit * float(np.exp(change[5])),
            focal=self.focal * float(np.exp(change[6])),
        )


@dataclass(frozen=True, slots=True, eq=False)
class SharedSheet:
    """A developable sheet in its own frame and units, and the cameras that see it.

    `skew_rad`, `slopes`, `bends` and `basis` are those of a `DevelopableSurface`; `slant_rad` is the type's.
    """

    skew_rad: float
    slopes: tuple[float, float]
    slant_rad: float
    bends: Vector
    basis: BendBasis
    held: tuple[HeldCamera, ...]

    def frame_at(self, page: tuple[float, float]) -> tuple[Floats, Vector]:
        """The text's axes and the normal (3, 3) at a page point, as columns, and the point in space (3,)."""
        return _frames(self._alone(), np.array([page]))[0]

    def _alone(self) -> DevelopableSurface:
        """The sheet in its own frame, one unit before it: its origin is at (0, 0, 1)."""
        return DevelopableSurface(
            _unskew(self.skew_rad), 1.0, (0.0, 0.0), self.skew_rad, self.slopes, self.bends, self.basis
        )

    @property
    def cameras(self) -> tuple[OtherCamera, ...]:
        """The cameras, in the sheet's frame."""
        frames = _frames(self._alone(), np.array([camera.held for camera in self.held]))
        found = []
        for camera, (axes, X) in zip(self.held, frames, strict=True):
            rotation = camera.rotation @ axes.T
            found.append(OtherCamera(rotation, camera.place - rotation @ X, camera.focal))
        return tuple(found)

    def surface(self, camera: OtherCamera) -> DevelopableSurface:
        """The sheet as a `camera` sees it, in page units of its own; see `unit_of`."""
        unit = unit_of(camera)
        x, y = camera.translation[:2] / unit
        basis = replace(
            self.basis, nodes=self.basis.nodes / unit, low=self.basis.low / unit, high=self.basis.high / unit
        )
        linear, quadratic = self.slopes
        return DevelopableSurface(
            camera.rotation @ _unskew(self.skew_rad),
            camera.focal,
            (float(x), float(y)),
            self.skew_rad,
            (linear * unit, quadratic * unit**2),
            self.bends * unit,
            basis,
        )

    def moved(self, step: Vector) -> "SharedSheet":
        """The sheet after a `step` of all unknowns."""
        shape, cameras = np.split(step, [OF_BENDS + len(self.bends)])
        changes = cameras.reshape(-1, CAMERA_UNKNOWNS)
        held = tuple(camera.moved(change) for camera, change in zip(self.held, changes, strict=True))
        linear, quadratic = np.array(self.slopes) + shape[OF_SLOPES]
        return replace(
            self,
            skew_rad=self.skew_rad + float(shape[OF_SKEW]),
            slopes=(float(linear), float(quadratic)),
            slant_rad=self.slant_rad + float(shape[OF_SLANT]),
            bends=self.bends + shape[OF_BENDS:],
            held=held,
        )

    def motions(self) -> Floats:
        """How each held point's frame moves with the shape: turn and shift (cameras, shape, 6), by differences."""
        points = np.array([camera.held for camera in self.held])
        here, count = _frames(self._alone(), points), OF_BENDS + len(self.bends)
        found = np.zeros((len(here), count, 6))
        rest = np.zeros(CAMERA_UNKNOWNS * len(self.held))
        for j in range(count):
            step = np.zeros(count)
            step[j] = PROBE
            there = _frames(self.moved(np.append(step, rest))._alone(), points)
            for k, ((F, X), (G, Y)) in enumerate(zip(here, there, strict=True)):
                turn = G @ F.T - F @ G.T
                found[k, j, :3] = np.array([turn[2, 1], turn[0, 2], turn[1, 0]]) / (2 * PROBE)
                found[k, j, 3:] = (Y - X) / PROBE
        return found


def hold_camera(sheet: SharedSheet, camera: OtherCamera, held: tuple[float, float]) -> HeldCamera:
    """The `camera`, in the sheet's frame, by the page point `held`."""
    axes, X = sheet.frame_at(held)
    place = camera.rotation @ X + camera.translation
    unit = float(place[2] / camera.focal)
    return HeldCamera(held, camera.rotation @ axes, place[:2] / unit, unit, camera.focal)


def camera_of(surface: DevelopableSurface) -> OtherCamera:
    """The camera that sees a `surface` of its own, whose page units are the sheet's."""
    axes = surface.rotation @ _unskew(surface.skew_rad).T
    return OtherCamera(axes, np.array([*surface.anchor, surface.focal]), surface.focal)


def unit_of(camera: OtherCamera) -> float:
    """What a page unit of the surface that a camera sees is in the sheet's units."""
    return float(camera.translation[2] / camera.focal)


def _unskew(skew_rad: float) -> Floats:
    c, s = np.cos(skew_rad), np.sin(skew_rad)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def _frames(alone: DevelopableSurface, page: Points) -> list[tuple[Floats, Vector]]:
    """The text's axes and the normal, as columns, and the point in space, at page points (N, 2)."""
    sheet = alone.to_sheet(page)
    X = alone.place(page) - [0.0, 0.0, 1.0]
    R = alone.line_at(sheet[:, 0])[1]
    N = alone.normals_at(sheet[:, 0])
    # The a-axis is what is left of R's perpendicular in the tangent plane: R = w A + B.
    w = alone.slope(sheet[:, 0])[:, None]
    A = (w * R + np.cross(R, N)) / (1 + w * w)
    A -= np.einsum("ij,ij->i", A, N)[:, None] * N
    A /= np.linalg.norm(A, axis=1, keepdims=True)
    axes = np.stack([A, np.cross(N, A), N], axis=2) @ _unskew(alone.skew_rad).T
    return list(zip(axes, X, strict=True))
