"""The residuals of the fit as functions of the unrolled page, with their exact derivatives.

The page is unrolled at the observed photo points, where the flat page is known to be simple: text lines run along u,
strokes along v (but for one unknown slant of the type), the points of a text line share one v, the lines of a
paragraph are equally spaced, flush ends share one u. Each is a residual in units of its own deviation.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from services.arrays import Floats, Points, Vector
from services.geometry.camera import rotation_from_vector
from services.robust import cauchy, soft_l1
from services.sheet.developable.observations import (
    FLOW_OVERLAP,
    MARGIN_DEVIATION,
    SLANT_MEAN_RAD,
    STROKE_OVERLAP,
    TILT_RAD,
    ObservationParameters,
    PageObservations,
    SideObservations,
)
from services.sheet.developable.surface import BendBasis, DevelopableSurface, Unrolled
from services.sheet.developable.variation import GLOBAL, LOG_FOCAL, SKEW, SLOPES, TURN, vary_page
from services.texture_flow.field import FlowSamples

SLANT = GLOBAL
"""Place of the type's slant among the parameters, after those of the sheet; then come the bends."""
BENDS = SLANT + 1
MIN_LOG_FOCAL, MAX_LOG_FOCAL = -1.05, 2.5
_PROBE = 0.002
"""Distance of the two photo points whose vector on the page is the flow's direction there (about 3 px)."""


# Standard deviations of observations and priors of a bent sheet; lengths in centred units.
MAJOR_RAD = np.deg2rad(0.3)
MINOR_RAD = np.deg2rad(0.5)
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
SIDE_FLOOR = 0.00015
"""Least deviation of a point of a side (a fifth of a pixel of two megapixels): edges are not seen better."""
GROWTH = 0.35
GROWTH_DEVIATION = 0.05
"""Under the text, neighbouring rulings may approach each other to about this share of their distance."""


@dataclass(frozen=True, slots=True)
class FittingParameters(ObservationParameters):
    """Standard deviations of observations and priors of a bent sheet; lengths in centred units."""

    line_factor: float = 1.0
    side_factor: float = 1.0
    cauchy_flows: bool = False
    """Whether the loss of flows is Cauchy's: flows of whole parts may be wrong (pictures that were read as text)."""
    max_evaluations: int = 40
    least_gain: float = 1e-5
    """Relative gain of the cost below which the fit ends."""


@dataclass(frozen=True, slots=True, eq=False)
class Residual:
    """Residuals (n,) in units of their deviations, before any loss, with derivatives (n, M)."""

    value: Vector
    slope: Floats


def under(loss: Callable[[Vector], tuple[Vector, Vector]], r: Residual) -> Residual:
    """Residuals whose squares are the `loss` (see `services.robust`) of `r`."""
    value, slope = loss(r.value)
    return Residual(value, r.slope * slope[:, None])


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


def _right_jacobian(w: Vector) -> Floats:
    """J_r with exp(w + d) = exp(w) exp(J_r d) for small d."""
    angle = float(np.linalg.norm(w))
    K = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    if angle < 1e-6:
        return np.asarray(np.eye(3) - 0.5 * K)
    return np.asarray(
        np.eye(3) - (1 - np.cos(angle)) / angle**2 * K + (angle - np.sin(angle)) / angle**3 * (K @ K)
    )


class StraightEdges:
    """The residuals of the sheet's sides: distances from four straight lines at right angles.

    Their common slope m against the print is that of least squares, so that it is no parameter: with x along each side
    and y across it, both from the side's mean, m = sum(w x y) / sum(w x x), and y - m x is left.
    """

    def __init__(self, edges: SideObservations, start: DevelopableSurface, p: FittingParameters) -> None:
        self.index, self.upright = edges.index, edges.upright
        # Across a side, one unit of the photo is this many units of the page; fixed at the start.
        grow = np.ones(len(self.index))
        if len(self.index):
            J = np.nan_to_num(start.jacobians(edges.points))
            grow = np.maximum(np.linalg.norm(J[np.arange(len(J)), (~self.upright).astype(int)], axis=1), 0.1)
        self.deviation = np.hypot(edges.deviations, SIDE_FLOOR) * p.side_factor * grow
        self.weight = 1 / self.deviation**2
        count = int(self.index.max()) + 1 if len(self.index) else 0
        total = np.bincount(self.index, self.weight, minlength=count)
        self.averages = csr_array(
            (self.weight / total[self.index], (self.index, np.arange(len(self.index)))),
            shape=(count, len(self.index)),
        )

    def residual(self, q: Points, dq: Floats) -> Residual:
        """Of page points (M, 2) with derivatives (M, 2, P)."""
        if not len(q):
            return Residual(np.zeros(0), np.zeros((0, dq.shape[2])))
        up = self.upright[:, None]
        # A quarter turn takes the upright sides to the others: (u, v) -> (v, -u).
        x, y = np.where(up, np.stack([q[:, 1], -q[:, 0]], axis=1), q).T
        dx, dy = np.where(up, dq[:, 1], dq[:, 0]), np.where(up, -dq[:, 0], dq[:, 1])
        x, y, dx, dy = (a - (self.averages @ a)[self.index] for a in (x, y, dx, dy))
        w = self.weight
        square = w @ (x * x)
        m = w @ (x * y) / square
        dm = ((w * x) @ dy + (w * y) @ dx - 2 * m * ((w * x) @ dx)) / square
        value, slope = y - m * x, dy - m * dx - x[:, None] * dm
        return Residual(value / self.deviation, slope / self.deviation[:, None])


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
        self.observed, self.lines = observed, observed.lines
        p, lines = parameters, observed.lines
        self.major_deviation = np.sqrt(FLOW_OVERLAP / np.maximum(observed.major.weights, 0.05)) * MAJOR_RAD
        self.minor_deviation = np.sqrt(STROKE_OVERLAP / np.maximum(observed.minor.weights, 0.05)) * MINOR_RAD
        margins = np.concatenate(lines.margins) if lines.margins else np.zeros((0, 2))
        ahead = [_ahead(flow) for flow in (observed.major, observed.minor)]
        parts = [
            observed.major.points,
            ahead[0],
            observed.minor.points,
            ahead[1],
            lines.points,
            margins,
            observed.hull,
            observed.edges.points,
        ]
        self.points = np.concatenate(parts)
        self.ends = np.cumsum([len(part) for part in parts])
        weight = 1 / np.maximum(lines.deviations, 1e-12) ** 2
        total = np.bincount(lines.index, weight, minlength=lines.count)
        # Averages of the points of a line, and differences from them.
        self.averages = csr_array(
            (weight / total[lines.index], (lines.index, np.arange(len(weight)))),
            shape=(lines.count, len(weight)),
        )
        # Across a line, one unit of the photo is |dv / d photo| units of the page; fixed at the start.
        grow = np.ones(len(weight))
        if len(weight):
            J = self.surface(start).jacobians(lines.points)
            grow = np.linalg.norm(J[:, 1], axis=1)
        self.line_deviation = lines.deviations * p.line_factor * np.maximum(grow, 1e-6)
        self.text_height = lines.text_height * (float(np.median(grow)) if len(grow) else 1.0)
        self.edges = StraightEdges(observed.edges, self.surface(start), p)
        self._last: tuple[bytes, Vector, Floats] | None = None

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
        at = surface.unroll(self.points - self.principal_point(x))
        turn = self.rotation @ rotation_from_vector(x[TURN]) @ _right_jacobian(x[TURN])
        moved = vary_page(surface, at, turn)
        by_slant = np.zeros((len(moved), 2, 1))
        parts = [moved[:, :, :SLANT], by_slant, moved[:, :, SLANT:]]
        if self.observed.principal_point:
            # The origin of the sheet keeps its place in the photo: points at its depth do not move.
            nearer = surface.focal / at.X[:, 2] - 1
            parts.append(at.jacobians * nearer[:, None, None])
        # As in `vary_page` the points come last in memory.
        return at, np.concatenate([part.transpose(2, 1, 0) for part in parts]).transpose(2, 1, 0)

    def parts(self, x: Vector) -> dict[str, Residual]:
        """Residuals of `major`, `minor`, `straight`, `spacing`, `margins`, `crossing`, `sides` before any loss."""
        at, dq = self.page(x)
        q, e = at.page, self.ends
        major = _direction(q, dq, slice(0, e[0]), slice(e[0], e[1]), 1)
        minor = _direction(q, dq, slice(e[1], e[2]), slice(e[2], e[3]), 0)
        minor.value[:] -= x[SLANT]
        minor.slope[:, SLANT] -= 1.0
        v, dv = q[e[3] : e[4], 1], dq[e[3] : e[4], 1]
        level, dlevel = self.averages @ v, self.averages @ dv
        index = self.lines.index
        straight = Residual(
            (v - level[index]) / self.line_deviation, (dv - dlevel[index]) / self.line_deviation[:, None]
        )
        return {
            "major": _over(major, self.major_deviation),
            "minor": _over(minor, self.minor_deviation),
            "straight": straight,
            "spacing": self._spacings(level, dlevel),
            "margins": self._margins(q[e[4] : e[5], 0], dq[e[4] : e[5], 0]),
            "crossing": self._crossing(at.sheet[e[5] : e[6]], x),
            "sides": self.edges.residual(q[e[6] :], dq[e[6] :]),
        }

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

    def _spacings(self, level: Vector, dlevel: Floats) -> Residual:
        """Lines of a run lie at equal steps; runs that are alike have equal steps."""
        p, m = self.p, dlevel.shape[1] if dlevel.ndim == 2 else 0
        values, slopes = [np.zeros(0)], [np.zeros((0, m))]
        logs, dlogs = [], []
        for run in self.lines.runs:
            t = run.order - run.order.mean()
            y, dy = level[run.lines], dlevel[run.lines]
            step, dstep = t @ y / (t @ t), t @ dy / (t @ t)
            size = max(abs(step), 1e-9)
            dlog = dstep / (step if abs(step) > 1e-9 else 1e-9)
            value = (y - y.mean() - step * t) / (size * p.spacing)
            values.append(value)
            slopes.append(
                (dy - dy.mean(axis=0) - t[:, None] * dstep) / (size * p.spacing) - value[:, None] * dlog
            )
            logs.append(np.log(size))
            dlogs.append(dlog)
        for group in self.lines.alike:
            log, rate = np.array([logs[k] for k in group]), np.array([dlogs[k] for k in group])
            weight = np.array([len(self.lines.runs[k].lines) for k in group], float)
            # The spacing of a short paragraph is less certain: its own deviation is added to the common one.
            deviation = np.hypot(p.spacing_between, p.spacing * np.sqrt(12.0) / weight**1.5)
            share = weight / weight.sum()
            values.append((log - share @ log) / deviation)
            slopes.append((rate - share @ rate) / deviation[:, None])
        return Residual(np.concatenate(values), np.concatenate(slopes))

    def _margins(self, u: Vector, du: Floats) -> Residual:
        value, slope = np.empty_like(u), np.empty_like(du)
        at = 0
        for margin in self.lines.margins:
            part = slice(at, at + len(margin))
            middle = at + int(np.argsort(u[part])[len(margin) // 2])
            value[part], slope[part] = u[part] - u[middle], du[part] - du[middle]
            at += len(margin)
        deviation = MARGIN_DEVIATION * self.text_height
        return Residual(value / deviation, slope / deviation)

    def _priors(self, x: Vector) -> Residual:
        p, k = self.p, x[BENDS : self.principal]
        eye = np.eye(len(x))
        of_bends = eye[BENDS : self.principal]
        first, second = np.diff(of_bends, axis=0), np.diff(of_bends, 2, axis=0)
        difference = np.full(len(first), BEND_DIFFERENCE)
        if not len(self.observed.edges.points):
            difference[:RIM_BENDS] = difference[len(first) - RIM_BENDS :] = RIM_DIFFERENCE
        tilt, dtilt = self._tilt(x)
        value = [
            (x[[LOG_FOCAL]] - self.observed.log_focal) / self.observed.focal_deviation,
            0.5 * np.sin(2 * x[[SKEW]]) / USUAL_SKEW_RAD,
            x[SLOPES] / SLOPE,
            (x[[SLANT]] - SLANT_MEAN_RAD) / p.slant_rad,
            tilt / TILT_RAD,
            np.diff(k) / difference,
            np.diff(k, 2) / BEND_CHANGE,
            k / BEND,
        ]
        slope = [
            eye[[LOG_FOCAL]] / self.observed.focal_deviation,
            np.cos(2 * x[SKEW]) * eye[[SKEW]] / USUAL_SKEW_RAD,
            eye[SLOPES] / SLOPE,
            eye[[SLANT]] / p.slant_rad,
            dtilt / TILT_RAD,
            first / difference[:, None],
            second / BEND_CHANGE,
            of_bends / BEND,
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

        def tilt(turn: Vector) -> Vector:
            N = self.rotation @ rotation_from_vector(turn)[:, 2]
            sine = max(float(np.hypot(N[0], N[1])), 1e-9)
            return np.asarray(N[:2] * np.arccos(np.clip(N[2], -1, 1)) / sine)

        slope = np.zeros((2, len(x)))
        for axis in range(3):
            d = step * np.eye(3)[axis]
            slope[:, axis] = (tilt(x[TURN] + d) - tilt(x[TURN] - d)) / (2 * step)
        return tilt(x[TURN]), slope

    def evaluate(self, x: Vector) -> tuple[Vector, Floats]:
        """Residuals (n,) under their losses, with the priors, and their derivatives (n, M)."""
        if self._last is None or self._last[0] != x.tobytes():
            parts = self.parts(x)
            # Single observations may be outliers, and groups may be wrong as a whole; priors are squared.
            of_flows = cauchy if self.p.cauchy_flows else soft_l1
            losses = {"major": of_flows, "minor": of_flows, "straight": soft_l1}
            losses |= {"spacing": cauchy, "margins": cauchy, "sides": cauchy}
            all_ = [*(under(loss, parts[name]) for name, loss in losses.items())]
            all_ += [parts["crossing"], self._priors(x)]
            value = np.concatenate([r.value for r in all_])
            self._last = (x.tobytes(), value, np.concatenate([r.slope for r in all_]))
        return self._last[1], self._last[2]


def _ahead(flow: FlowSamples) -> Points:
    return np.asarray(flow.points + _PROBE * np.stack([np.cos(flow.angles), np.sin(flow.angles)], axis=1))


def _direction(q: Points, dq: Floats, here: slice, there: slice, across: int) -> Residual:
    """Angle on the page of the vectors from `here` to `there` against the axis 1 - `across`."""
    way, dway = q[there] - q[here], dq[there] - dq[here]
    a, b = way[:, 1 - across], way[:, across]
    a = np.where(a == 0, 1e-15, a)
    square = np.maximum(a * a + b * b, 1e-30)
    slope = (a[:, None] * dway[:, across] - b[:, None] * dway[:, 1 - across]) / square[:, None]
    return Residual(np.arctan(b / a), slope)


def _over(r: Residual, deviation: Vector) -> Residual:
    return Residual(r.value / deviation, r.slope / deviation[:, None])
