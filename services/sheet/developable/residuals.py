"""The residuals of the fit of one photo's surface, with their exact derivatives: of its print, and priors."""

import numpy as np

from services.arrays import Floats, Points, Vector
from services.geometry.camera import rotation_from_vector
from services.robust import cauchy
from services.sheet.developable.observations import SLANT_MEAN_RAD, TILT_RAD, PageObservations
from services.sheet.developable.print_residuals import FittingParameters, PrintResiduals, Residual, under
from services.sheet.developable.surface import BendBasis, DevelopableSurface, Unrolled
from services.sheet.developable.variation import GLOBAL, LOG_FOCAL, SKEW, SLOPES, TURN, vary_page

SLANT = GLOBAL
"""Place of the type's slant among the parameters, after those of the sheet; then come the bends."""
BENDS = SLANT + 1
MIN_LOG_FOCAL, MAX_LOG_FOCAL = -1.05, 2.5


# Standard deviations of priors of a bent sheet; lengths in centred units.
USUAL_SKEW_RAD = np.deg2rad(12.0)
"""Sheets bend across or along their text lines more often than diagonally: deviation of sin(2 skew) / 2."""
SLOPE = 0.15
"""Deviation of the slope of the rulings, per unit: books and bent sheets are nearly cylinders."""
BEND = 6.0
"""Deviation of the curvature of the a-axis, per unit."""
BEND_DIFFERENCE = 3.0
BEND_CHANGE = 1.0
"""Deviations of the first and second differences of neighbouring bends."""
RIM_DIFFERENCE = 0.7
RIM_BENDS = 2
"""Deviation of the first differences of this many bends at either end, beyond the text: the bend continues. Where
the sheet's sides are seen, they show the bend there."""
UNCREASED_BENDS = 3
"""This many bends at either end change as on paper without creases where several photos show the sheet: with two a flat
page folded beyond its text, as it did where creases are cheap there."""
GROWTH = 0.35
GROWTH_DEVIATION = 0.05
"""Under the text, neighbouring rulings may approach each other to about this share of their distance."""


def surface_of(
    x: Vector, rotation: Floats, anchor: tuple[float, float], basis: BendBasis
) -> DevelopableSurface:
    """Surface of the parameters x (8 + K,): turn of `rotation` (3), log f, skew, slopes (2), slant, bends.

    `rotation` has the text's axes as columns; the sheet's a-axis lies `skew` before the text's direction.
    """
    c, s = np.cos(x[SKEW]), np.sin(x[SKEW])
    unskew = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    focal = float(np.exp(np.clip(x[LOG_FOCAL], MIN_LOG_FOCAL, MAX_LOG_FOCAL)))
    linear, quadratic = x[SLOPES]
    turned = rotation @ rotation_from_vector(x[TURN]) @ unskew
    return DevelopableSurface(
        turned, focal, anchor, float(x[SKEW]), (float(linear), float(quadratic)), x[BENDS:], basis
    )


def bend_priors(bends: Vector, slope: Floats, spacing: float, sides_seen: bool) -> Residual:
    """The bends (K,) are small and change little and slowly; `slope` (K, M) are their derivatives.

    Their sums stand for integrals of k^2, k'^2 and k''^2 along the sheet, so that splines that are `spacing` times as
    far apart have the same ones. Paper may have creases: to fine splines large changes of the bend are cheap (Cauchy's
    loss). Not to wide ones, which are fitted first: at the end of a flat page's text one made a fold.
    """
    uncreased = 0 if spacing < 1.0 else len(bends)
    rim = 0 if sides_seen else round(RIM_BENDS / spacing)
    return _bend_priors(bends, slope, spacing, rim, uncreased)


def shared_bend_priors(bends: Vector, slope: Floats, spacing: float) -> Residual:
    """The same of a sheet that several photos show: beyond the text its bend may change, but has no creases."""
    return _bend_priors(bends, slope, spacing, 0, round(UNCREASED_BENDS / spacing))


def _bend_priors(bends: Vector, slope: Floats, spacing: float, rim: int, uncreased: int) -> Residual:
    """The `rim` first and last differences are nearly zero; no creases are at as many changes as `uncreased`."""
    first, second = np.diff(slope, axis=0), np.diff(slope, 2, axis=0)
    difference = np.full(len(first), BEND_DIFFERENCE)
    difference[:rim] = difference[len(first) - rim :] = RIM_DIFFERENCE
    difference *= spacing**0.5
    change, size = BEND_CHANGE * spacing**1.5, BEND * spacing**-0.5
    changes = Residual(np.diff(bends, 2) / change, second / change)
    creased = under(cauchy, changes)
    inner = np.zeros(len(second), bool)
    inner[uncreased : len(second) - uncreased] = True
    return Residual(
        np.concatenate(
            [np.diff(bends) / difference, np.where(inner, creased.value, changes.value), bends / size]
        ),
        np.concatenate(
            [
                first / difference[:, None],
                np.where(inner[:, None], creased.slope, changes.slope),
                slope / size,
            ]
        ),
    )


def _right_jacobian(w: Vector) -> Floats:
    """J_r with exp(w + d) = exp(w) exp(J_r d) for small d."""
    angle = float(np.linalg.norm(w))
    K = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    if angle < 1e-6:
        return np.asarray(np.eye(3) - 0.5 * K)
    return np.asarray(
        np.eye(3) - (1 - np.cos(angle)) / angle**2 * K + (angle - np.sin(angle)) / angle**3 * (K @ K)
    )


class PageResiduals:
    """All residuals and their derivatives at a vector of parameters; all photo points are unrolled at once."""

    def __init__(
        self,
        rotation: Floats,
        anchor: tuple[float, float],
        basis: BendBasis,
        observed: PageObservations,
        start: Vector,
        parameters: FittingParameters,
    ) -> None:
        self.rotation, self.anchor, self.basis, self.p = rotation, anchor, basis, parameters
        self.principal = BENDS + basis.values.shape[1]
        self.observed = observed
        self.print = PrintResiduals(observed, self.surface(start), parameters)
        self._last: tuple[bytes, dict[str, Residual]] | None = None
        self._under_losses: tuple[bytes, Vector, Floats] | None = None

    def surface(self, x: Vector) -> DevelopableSurface:
        """Surface of the parameters `x`, in coordinates relative to their principal point."""
        x0, y0 = self.principal_point(x)
        anchor = (self.anchor[0] - x0, self.anchor[1] - y0)
        return surface_of(x[: self.principal], self.rotation, anchor, self.basis)

    def principal_point(self, x: Vector) -> tuple[float, float]:
        """Principal point of the parameters `x` in centred coordinates; the origin where it is not free."""
        free = x[self.principal :]
        return (float(free[0]), float(free[1])) if len(free) else (0.0, 0.0)

    def page(self, x: Vector) -> tuple[Unrolled, Floats]:
        """All observed points unrolled, and derivatives (N, 2, M) of the page points by all parameters."""
        surface = self.surface(x)
        at = surface.unroll(self.print.points - self.principal_point(x))
        turn = self.rotation @ rotation_from_vector(x[TURN]) @ _right_jacobian(x[TURN])
        free = len(x) - self.principal
        moved = vary_page(surface, at, turn, still=BENDS - SLANT, room=free)
        if free:
            # The origin of the sheet keeps its place in the photo: points at its depth do not move.
            nearer = surface.focal / at.X[:, 2] - 1
            np.multiply(at.jacobians, nearer[:, None, None], out=moved[:, :, self.principal :])
        return at, moved

    def parts(self, x: Vector) -> dict[str, Residual]:
        """Residuals of the print, the sides, and `crossing`, before any loss."""
        # A fit mostly ends where it has evaluated last, and asks for the parts there.
        if self._last is None or self._last[0] != x.tobytes():
            at, dq = self.page(x)
            parts = self.print.parts(at.page, dq, float(x[SLANT]), SLANT)
            hull = slice(*self.print.ends[5:7])
            self._last = (x.tobytes(), {**parts, "crossing": self._crossing(at.sheet[hull], x)})
        return self._last[1]

    def _crossing(self, sheet: Points, x: Vector) -> Residual:
        """Rulings do not cross under the text: 1 + t w'(s) is at least `growth`."""
        s, t = sheet.T
        rates = np.stack([t, 2 * s * t], axis=1)
        short = GROWTH - (1 + rates @ x[SLOPES])
        slope = np.zeros((len(s), len(x)))
        slope[:, SLOPES] = -rates
        near = short > 0
        return Residual(
            np.where(near, short, 0.0) / GROWTH_DEVIATION,
            slope * near[:, None] / GROWTH_DEVIATION,
        )

    def _priors(self, x: Vector) -> Residual:
        p = self.p
        eye = np.eye(len(x))
        sides_seen = len(self.observed.edges.points) > 0
        bends = bend_priors(
            x[BENDS : self.principal], eye[BENDS : self.principal], self.basis.spacing, sides_seen
        )
        tilt, dtilt = self._tilt(x)
        value = [
            (x[[LOG_FOCAL]] - self.observed.log_focal) / self.observed.focal_deviation,
            0.5 * np.sin(2 * x[[SKEW]]) / USUAL_SKEW_RAD,
            x[SLOPES] / SLOPE,
            (x[[SLANT]] - SLANT_MEAN_RAD) / p.slant_rad,
            tilt / TILT_RAD,
            bends.value,
        ]
        slope = [
            eye[[LOG_FOCAL]] / self.observed.focal_deviation,
            np.cos(2 * x[SKEW]) * eye[[SKEW]] / USUAL_SKEW_RAD,
            eye[SLOPES] / SLOPE,
            eye[[SLANT]] / p.slant_rad,
            dtilt / TILT_RAD,
            bends.slope,
        ]
        if self.observed.principal_point:
            offset, deviations = x[self.principal :], np.array(self.observed.principal_point.deviations)
            value.append((offset - self.observed.principal_point.mean) / deviations)
            slope.append(eye[self.principal :] / deviations[:, None])
            growth, rate = self.observed.principal_point.log_growth(offset)
            value[0] = value[0] - growth / self.observed.focal_deviation
            slope[0] = slope[0] - rate @ eye[self.principal :] / self.observed.focal_deviation
        return Residual(np.concatenate(value), np.concatenate(slope))

    def _tilt(self, x: Vector, step: float = 1e-5) -> tuple[Vector, Floats]:
        """The normal's angle from the optical axis as a vector (2,), and its derivative by differences."""

        turns = x[TURN] + step * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
        angles = np.maximum(np.linalg.norm(turns, axis=1), 1e-300)
        a, b, c = (turns / angles[:, None]).T
        sine, cosine = np.sin(angles), np.cos(angles)
        # Third columns of the rotations, by Rodrigues' formula.
        normals = np.stack([(1 - cosine) * a * c + sine * b, (1 - cosine) * b * c - sine * a, cosine], axis=1)
        normals[:, 2] += (1 - cosine) * c * c
        N = normals @ self.rotation.T
        sines = np.maximum(np.hypot(N[:, 0], N[:, 1]), 1e-9)
        tilts = N[:, :2] * (np.arccos(np.clip(N[:, 2], -1, 1)) / sines)[:, None]
        slope = np.zeros((2, len(x)))
        slope[:, TURN] = (tilts[1:4] - tilts[4:]).T / (2 * step)
        return tilts[0], slope

    def evaluate(self, x: Vector) -> tuple[Vector, Floats]:
        """Residuals (n,) under their losses, with the priors, and their derivatives (n, M)."""
        if self._under_losses is None or self._under_losses[0] != x.tobytes():
            parts = self.parts(x)
            all_ = [*self.print.under_losses(parts), parts["crossing"], self._priors(x)]
            value = np.concatenate([r.value for r in all_])
            self._under_losses = (x.tobytes(), value, np.concatenate([r.slope for r in all_]))
        return self._under_losses[1], self._under_losses[2]
