"""One bent sheet that several photos show parts of: its shape, their cameras, and the fit of both together.

The sheet has a frame of its own: the text's axes and the normal at its origin. A camera sees a point X of it at
f (Y_1, Y_2) / Y_3 with Y = R X + t. Seen by one camera, in the units in which the origin's depth t_3 is its focal
length f, it is a `DevelopableSurface` with the origin at f (t_1, t_2) / t_3; a unit there is t_3 / f of the sheet's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Floats, Points, Vector
from services.geometry.camera import rotation_from_vector
from services.robust import cauchy
from services.sheet.developable.observations import SLANT_MEAN_RAD, PageObservations
from services.sheet.developable.print_residuals import FittingParameters, PrintResiduals, Residual, under
from services.sheet.developable.residuals import (
    BEND,
    BEND_CHANGE,
    BEND_DIFFERENCE,
    RIM_BENDS,
    RIM_DIFFERENCE,
    SLOPE,
    USUAL_SKEW_RAD,
)
from services.sheet.developable.surface import BendBasis, DevelopableSurface
from services.sheet.developable.variation import GLOBAL, SKEW, SLOPES, TURN, vary_page
from services.sheet.ridged.views import CAMERA_UNKNOWNS, OtherCamera

OF_SKEW, OF_SLOPES, OF_SLANT, OF_BENDS = 0, slice(1, 3), 3, 4
"""Places among the unknowns of the shape; those of the cameras follow it."""
MOST_STEPS = 60
LEAST_GAIN = 1e-5
"""Relative gain of the cost below which the fit ends."""
MOST_DAMPING = 1e6


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
    cameras: tuple[OtherCamera, ...]

    def unit(self, number: int) -> float:
        """What a page unit of `surface` is in the sheet's units."""
        camera = self.cameras[number]
        return float(camera.translation[2] / camera.focal)

    def surface(self, number: int) -> DevelopableSurface:
        """The sheet as camera `number` sees it, in the page units of this camera."""
        camera, unit = self.cameras[number], self.unit(number)
        c, s = np.cos(self.skew_rad), np.sin(self.skew_rad)
        unskew = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        x, y = camera.translation[:2] / unit
        basis = replace(
            self.basis, nodes=self.basis.nodes / unit, low=self.basis.low / unit, high=self.basis.high / unit
        )
        linear, quadratic = self.slopes
        return DevelopableSurface(
            camera.rotation @ unskew,
            camera.focal,
            (float(x), float(y)),
            self.skew_rad,
            (linear * unit, quadratic * unit**2),
            self.bends * unit,
            basis,
        )

    def moved(self, step: Vector) -> "SharedSheet":
        """The sheet after a `step` of all unknowns; a camera turns about the sheet's origin."""
        shape, cameras = np.split(step, [OF_BENDS + len(self.bends)])
        moved = []
        for camera, change in zip(self.cameras, cameras.reshape(-1, CAMERA_UNKNOWNS), strict=True):
            turn = rotation_from_vector(change[:3])
            focal = camera.focal * float(np.exp(change[6]))
            moved.append(OtherCamera(turn @ camera.rotation, camera.translation + change[3:6], focal))
        linear, quadratic = np.array(self.slopes) + shape[OF_SLOPES]
        return replace(
            self,
            skew_rad=self.skew_rad + float(shape[OF_SKEW]),
            slopes=(float(linear), float(quadratic)),
            slant_rad=self.slant_rad + float(shape[OF_SLANT]),
            bends=self.bends + shape[OF_BENDS:],
            cameras=tuple(moved),
        )


@dataclass(frozen=True, slots=True, eq=False)
class SeenPart:
    """What one photo shows of the sheet, with the deviations of its print."""

    observed: PageObservations
    parameters: FittingParameters


@dataclass(frozen=True, slots=True, eq=False)
class SharedPoints:
    """Points (N, 2) of the photos `a` and `b`, centred in either, that are one; `deviation` is in units of the sheet."""

    a: int
    b: int
    points_a: Points
    points_b: Points
    deviation: float


@dataclass(frozen=True, slots=True, eq=False)
class FittedSheet:
    """The sheet of least cost near the start."""

    sheet: SharedSheet
    cost: float
    evaluations: int


def fit_shared_sheet(
    start: SharedSheet, parts: Sequence[SeenPart], shared: Sequence[SharedPoints]
) -> FittedSheet:
    """The sheet near `start` that explains the print of all `parts`, and the points that they share.

    Levenberg's and Marquardt's method on squares under robust losses. That the sheet's origin and unit are free is no
    harm: damping keeps them.
    """
    residuals = _SheetResiduals(start, parts, shared)
    sheet, (cost, A, g) = start, residuals.normal_equations(start)
    damping, growth, count = 1e-3, 4.0, 1
    while count < MOST_STEPS and damping < MOST_DAMPING:
        diagonal = np.diag(A)
        held = A + np.diag(damping * diagonal + 1e-10 * diagonal.max())
        step = np.linalg.solve(held, -g)
        moved = sheet.moved(step)
        count += 1
        new_cost, new_A, new_g = residuals.normal_equations(moved)
        if np.isfinite(new_cost) and new_cost < cost:
            gained = (cost - new_cost) / max(cost, 1e-12)
            sheet, cost, A, g = moved, new_cost, new_A, new_g
            damping, growth = max(damping / 5, 1e-9), 4.0
            if gained < LEAST_GAIN:
                break
        else:
            damping, growth = damping * growth, 2 * growth
    return FittedSheet(sheet, cost, count)


class _SheetResiduals:
    """Cost of a sheet, and its derivatives."""

    def __init__(
        self, start: SharedSheet, parts: Sequence[SeenPart], shared: Sequence[SharedPoints]
    ) -> None:
        self.parts, self.shared = parts, shared
        self.prints = [
            PrintResiduals(part.observed, start.surface(k), part.parameters, start.unit(k))
            for k, part in enumerate(parts)
        ]
        self.shape = OF_BENDS + len(start.bends)
        self.unknowns = self.shape + CAMERA_UNKNOWNS * len(parts)
        self.points, self.slices = [], []
        for k, print_ in enumerate(self.prints):
            points, slices, at = [print_.points], {}, len(print_.points)
            for number, pair in enumerate(shared):
                if k in (pair.a, pair.b):
                    own = pair.points_a if k == pair.a else pair.points_b
                    slices[number] = slice(at, at + len(own))
                    points.append(own)
                    at += len(own)
            self.points.append(np.concatenate(points))
            self.slices.append(slices)

    def normal_equations(self, sheet: SharedSheet) -> tuple[float, Floats, Vector]:
        """Half the sum of squares, their Gauss-Newton matrix, and half their gradient."""
        A, g, cost = np.zeros((self.unknowns, self.unknowns)), np.zeros(self.unknowns), 0.0
        pages = [self._page(sheet, k) for k in range(len(self.parts))]

        def add(residual: Residual, columns: Vector) -> None:
            nonlocal cost
            A[np.ix_(columns, columns)] += residual.slope.T @ residual.slope
            g[columns] += residual.slope.T @ residual.value
            cost += 0.5 * float(residual.value @ residual.value)

        for k, (print_, (q, dq)) in enumerate(zip(self.prints, pages, strict=True)):
            own = len(print_.points)
            parts = print_.parts(q[:own], dq[:own], sheet.slant_rad, OF_SLANT)
            for residual in print_.under_losses(parts):
                add(residual, self._columns(k))
        for number, pair in enumerate(self.shared):
            ends = [(pages[k][0][at], pages[k][1][at]) for k, at in self._ends(number, pair)]
            (q_a, dq_a), (q_b, dq_b) = ends
            s = self.shape
            slope = np.concatenate([dq_a[..., :s] - dq_b[..., :s], dq_a[..., s:], -dq_b[..., s:]], axis=2)
            apart = Residual(
                (q_a - q_b).ravel() / pair.deviation, slope.reshape(-1, slope.shape[2]) / pair.deviation
            )
            columns = np.concatenate([self._columns(pair.a), self._columns(pair.b)[s:]])
            add(under(cauchy, apart), columns)
        add(self._priors(sheet), np.arange(self.unknowns))
        return cost, A, g

    def _ends(self, number: int, pair: SharedPoints) -> list[tuple[int, slice]]:
        return [(k, self.slices[k][number]) for k in (pair.a, pair.b)]

    def _columns(self, k: int) -> Vector:
        first = self.shape + CAMERA_UNKNOWNS * k
        return np.concatenate([np.arange(self.shape), np.arange(first, first + CAMERA_UNKNOWNS)])

    def _page(self, sheet: SharedSheet, k: int) -> tuple[Points, Floats]:
        """Page points (N, 2), in the sheet's units, of photo `k`, with derivatives by the shape and its camera."""
        surface, unit, camera = sheet.surface(k), sheet.unit(k), sheet.cameras[k]
        at = surface.unroll(self.points[k])
        own = vary_page(surface, at) * unit
        dq = np.zeros((len(at.page), 2, self.shape + CAMERA_UNKNOWNS))
        dq[..., OF_SKEW] = own[..., SKEW]
        # Of slopes and bends a unit of the camera's page is `unit` of the sheet's.
        dq[..., OF_SLOPES] = own[..., SLOPES] * [unit, unit**2]
        dq[..., OF_BENDS : self.shape] = own[..., GLOBAL:] * unit
        dq[..., self.shape : self.shape + 3] = own[..., TURN]
        # Where the image moves by dx, the page at a fixed photo point moves by -J dx.
        J = at.jacobians * unit
        for axis in range(2):
            dq[..., self.shape + 3 + axis] = (
                -J[..., axis] * camera.focal / (at.X[:, 2:] * unit)
            )
        inward = np.einsum("nij,nj->ni", J, at.centred)
        dq[..., self.shape + 5] = inward / (at.X[:, 2:] * unit)
        dq[..., self.shape + 6] = -inward
        return at.page * unit, dq

    def _priors(self, sheet: SharedSheet) -> Residual:
        eye = np.eye(self.unknowns)
        k, of_bends = sheet.bends, eye[OF_BENDS : self.shape]
        difference = np.full(len(k) - 1, BEND_DIFFERENCE)
        difference[:RIM_BENDS] = difference[len(difference) - RIM_BENDS :] = RIM_DIFFERENCE
        focal = [np.log(camera.focal) for camera in sheet.cameras]
        mean = [part.observed.log_focal for part in self.parts]
        deviation = np.array([part.observed.focal_deviation for part in self.parts])
        of_focal = eye[self.shape + CAMERA_UNKNOWNS - 1 :: CAMERA_UNKNOWNS]
        slant_rad = self.parts[0].parameters.slant_rad
        value = [
            (np.array(focal) - mean) / deviation,
            [0.5 * np.sin(2 * sheet.skew_rad) / USUAL_SKEW_RAD],
            np.array(sheet.slopes) / SLOPE,
            [(sheet.slant_rad - SLANT_MEAN_RAD) / slant_rad],
            np.diff(k) / difference,
            np.diff(k, 2) / BEND_CHANGE,
            k / BEND,
        ]
        slope = [
            of_focal / deviation[:, None],
            np.cos(2 * sheet.skew_rad) * eye[[OF_SKEW]] / USUAL_SKEW_RAD,
            eye[OF_SLOPES] / SLOPE,
            eye[[OF_SLANT]] / slant_rad,
            np.diff(of_bends, axis=0) / difference[:, None],
            np.diff(of_bends, 2, axis=0) / BEND_CHANGE,
            of_bends / BEND,
        ]
        return Residual(np.concatenate(value), np.concatenate(slope))
