"""Fit of one bent sheet and the cameras before it to what photos show of its parts, and to the points they share."""

from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector
from services.robust import cauchy
from services.sheet.developable.observations import SLANT_MEAN_RAD, PageObservations
from services.sheet.developable.print_residuals import FittingParameters, PrintResiduals, Residual, under
from services.sheet.developable.residuals import SLOPE, USUAL_SKEW_RAD, shared_bend_priors
from services.sheet.developable.variation import GLOBAL, SKEW, SLOPES, vary_page
from services.sheet.ridged.parameters import MAX_DAMPING
from services.sheet.ridged.views import CAMERA_UNKNOWNS, OtherCamera
from services.sheet.shared_sheet import OF_BENDS, OF_SKEW, OF_SLANT, OF_SLOPES, SharedSheet, unit_of

MOST_STEPS = 60
SCHEDULE = ((30.0, 1e-2), (5.0, 1e-2), (1.0, 1e-4))
"""Factors on the deviations of shared points, one fit after the other, and the gain of the cost at which each ends."""


@dataclass(frozen=True, slots=True, eq=False)
class SeenPart:
    """What one photo shows of the sheet, with the deviations of its print.

    Photos of one `camera` have one focal length.
    """

    observed: PageObservations
    parameters: FittingParameters
    camera: Hashable


@dataclass(frozen=True, slots=True, eq=False)
class SharedPoints:
    """Points (N, 2) of the photos `a` and `b`, centred in either, that are one; `deviation` is in sheet units."""

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

    Squares under robust losses. Those of shared points are wide at first, since the start has them pixels apart.
    """
    sheet, count = _with_common_focals(start, parts), 0
    for slack, gain in SCHEDULE:
        eased = [replace(pair, deviation=slack * pair.deviation) for pair in shared]
        sheet, cost, used = _minimize(sheet, _SheetResiduals(sheet, parts, eased), gain)
        count += used
    return FittedSheet(sheet, cost, count)


def _minimize(
    sheet: SharedSheet, residuals: "_SheetResiduals", gain: float
) -> tuple[SharedSheet, float, int]:
    """The sheet of least cost near the start, that cost, and the evaluations it took (Levenberg and Marquardt)."""
    cost, A, g = residuals.normal_equations(sheet)
    T = residuals.free_unknowns()
    damping, growth, count = 1e-3, 4.0, 1
    while count < MOST_STEPS and damping < MAX_DAMPING:
        free = T.T @ A @ T
        diagonal = np.diag(free)
        held = free + np.diag(damping * diagonal + 1e-12 * diagonal.max())
        moved = sheet.moved(T @ np.linalg.solve(held, -T.T @ g))
        count += 1
        new_cost, new_A, new_g = residuals.normal_equations(moved)
        if np.isfinite(new_cost) and new_cost < cost:
            gained = (cost - new_cost) / max(cost, 1e-12)
            sheet, cost, A, g = moved, new_cost, new_A, new_g
            damping, growth = max(damping / 5, 1e-9), 4.0
            if gained < gain:
                break
        else:
            damping, growth = damping * growth, 2 * growth
    return sheet, cost, count


def _with_common_focals(sheet: SharedSheet, parts: Sequence[SeenPart]) -> SharedSheet:
    """The sheet with the mean focal length of each camera in all of its photos."""
    held = []
    for part, own in zip(parts, sheet.held, strict=True):
        logs = [
            np.log(camera.focal)
            for other, camera in zip(parts, sheet.held, strict=True)
            if other.camera == part.camera
        ]
        held.append(replace(own, focal=float(np.exp(np.mean(logs)))))
    return replace(sheet, held=tuple(held))


class _SheetResiduals:
    """Cost of a sheet, and its derivatives."""

    def __init__(self, start: SharedSheet, parts: Sequence[SeenPart], shared: Sequence[SharedPoints]) -> None:
        self.parts, self.shared = parts, shared
        self.prints = [
            PrintResiduals(part.observed, start.surface(camera), part.parameters, unit_of(camera))
            for part, camera in zip(parts, start.cameras, strict=True)
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
        seen = zip(sheet.cameras, sheet.motions(), strict=True)
        pages = [self._page(sheet, k, *camera) for k, camera in enumerate(seen)]

        def add(residual: Residual, columns: NDArray[np.intp]) -> None:
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

    def free_unknowns(self) -> Floats:
        """How all unknowns depend on those that are free (unknowns, free).

        The sheet's origin and unit are held by the first camera's anchor and unit: else the priors of the bends would
        let the unit grow. Photos of one camera have one focal length.
        """
        T, first = np.eye(self.unknowns), self.shape
        owners: dict[Hashable, int] = {}
        dropped = [first + 3, first + 4, first + 5]
        for k, part in enumerate(self.parts):
            at = int(self._columns(k)[-1])
            owner = owners.setdefault(part.camera, at)
            if owner != at:
                T[at, owner] = 1.0
                dropped.append(at)
        return np.delete(T, dropped, axis=1)

    def _ends(self, number: int, pair: SharedPoints) -> list[tuple[int, slice]]:
        return [(k, self.slices[k][number]) for k in (pair.a, pair.b)]

    def _columns(self, k: int) -> NDArray[np.intp]:
        first = self.shape + CAMERA_UNKNOWNS * k
        return np.concatenate([np.arange(self.shape), np.arange(first, first + CAMERA_UNKNOWNS)])

    def _page(
        self, sheet: SharedSheet, k: int, camera: OtherCamera, motions: Floats
    ) -> tuple[Points, Floats]:
        """Page points (N, 2), in the sheet's units, of photo `k`, with derivatives by the shape and its camera."""
        surface, unit, held = sheet.surface(camera), unit_of(camera), sheet.held[k]
        at = surface.unroll(self.points[k])
        own = vary_page(surface, at) * unit
        Y, J = at.X * unit, at.jacobians * unit
        # Where a point moves by dY, its image does by P dY, and the page at a fixed photo point by G dY = -J P dY.
        P = np.zeros((len(Y), 2, 3))
        P[:, 0, 0] = P[:, 1, 1] = camera.focal
        P[:, :, 2] = -at.centred
        G = -J @ (P / Y[:, 2, None, None])
        by_turn = np.cross((Y - held.place)[:, None, :], G)
        dq = np.zeros((len(Y), 2, self.shape + CAMERA_UNKNOWNS))
        dq[..., OF_SKEW] = own[..., SKEW]
        # Of slopes and bends a unit of the camera's page is `unit` of the sheet's.
        dq[..., OF_SLOPES] = own[..., SLOPES] * [unit, unit**2]
        dq[..., OF_BENDS : self.shape] = own[..., GLOBAL:] * unit
        # The camera goes with the frame of its held point.
        turns, shifts = motions[:, :3] @ camera.rotation.T, motions[:, 3:] @ camera.rotation.T
        dq[..., : self.shape] -= by_turn @ turns.T + G @ shifts.T
        dq[..., self.shape : self.shape + 3] = by_turn
        dq[..., self.shape + 3 : self.shape + 5] = held.unit * G[..., :2]
        dq[..., self.shape + 5] = G @ held.place
        inward = np.einsum("nij,nj->ni", J, at.centred)
        dq[..., self.shape + 6] = held.unit * held.focal * G[..., 2] - inward
        return at.page * unit, dq

    def _priors(self, sheet: SharedSheet) -> Residual:
        eye = np.eye(self.unknowns)
        bends = shared_bend_priors(sheet.bends, eye[OF_BENDS : self.shape], sheet.basis.spacing)
        focal = [np.log(camera.focal) for camera in sheet.held]
        mean = [part.observed.log_focal for part in self.parts]
        # What is known of a camera counts once, however many photos it took.
        photos = Counter(part.camera for part in self.parts)
        deviation = np.array(
            [part.observed.focal_deviation * np.sqrt(photos[part.camera]) for part in self.parts]
        )
        of_focal = eye[self.shape + CAMERA_UNKNOWNS - 1 :: CAMERA_UNKNOWNS]
        slant_rad = self.parts[0].parameters.slant_rad
        value = [
            (np.array(focal) - mean) / deviation,
            [0.5 * np.sin(2 * sheet.skew_rad) / USUAL_SKEW_RAD],
            np.array(sheet.slopes) / SLOPE,
            [(sheet.slant_rad - SLANT_MEAN_RAD) / slant_rad],
            bends.value,
        ]
        slope = [
            of_focal / deviation[:, None],
            np.cos(2 * sheet.skew_rad) * eye[[OF_SKEW]] / USUAL_SKEW_RAD,
            eye[OF_SLOPES] / SLOPE,
            eye[[OF_SLANT]] / slant_rad,
            bends.slope,
        ]
        return Residual(np.concatenate(value), np.concatenate(slope))
