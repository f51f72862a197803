"""Residuals of the print that one photo shows, and of its sheet's sides, as functions of the unrolled page.

The page is unrolled at the observed photo points, where the flat page is known to be simple: text lines run along u,
strokes along v (but for one unknown slant of the type), the points of a text line share one v, the lines of a
paragraph are equally spaced, flush ends share one u. Each is a residual in units of its own deviation, with its
derivatives by whatever parameters move the page.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from services.arrays import Floats, Points, Vector
from services.robust import cauchy, soft_l1
from services.sheet.developable.observations import (
    FLOW_OVERLAP,
    MARGIN_DEVIATION,
    STROKE_OVERLAP,
    ObservationParameters,
    PageObservations,
    SideObservations,
)
from services.sheet.developable.surface import DevelopableSurface
from services.texture_flow.field import FlowSamples

_PROBE = 0.002
"""Distance of the two photo points whose vector on the page is the flow's direction there (about 3 px)."""
MAJOR_RAD = np.deg2rad(0.3)
MINOR_RAD = np.deg2rad(0.5)
"""Deviations of directions along and across the text lines."""
SIDE_FLOOR = 0.00015
"""Least deviation of a point of a side (a fifth of a pixel of two megapixels): edges are not seen better."""


@dataclass(frozen=True, slots=True)
class FittingParameters(ObservationParameters):
    """Standard deviations of observations and priors of a bent sheet; lengths in centred units."""

    line_factor: float = 1.0
    side_factor: float = 1.0
    major_factor: float = 1.0
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


class StraightEdges:
    """The residuals of the sheet's sides: distances from four straight lines at right angles.

    Their common slope m against the print is that of least squares, so that it is no parameter: with x along each side
    and y across it, both from the side's mean, m = sum(w x y) / sum(w x x), and y - m x is left.
    """

    def __init__(
        self, edges: SideObservations, start: DevelopableSurface, p: FittingParameters, unit: float
    ) -> None:
        self.index, self.upright = edges.index, edges.upright
        # Across a side, one unit of the photo is this many units of the page; fixed at the start.
        grow = np.ones(len(self.index))
        if len(self.index):
            J = np.nan_to_num(start.jacobians(edges.points))
            grow = np.maximum(np.linalg.norm(J[np.arange(len(J)), (~self.upright).astype(int)], axis=1), 0.1)
            grow *= unit
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


class PrintResiduals:
    """The residuals of what one photo shows, at its `points` (N, 2), centred, once these are unrolled.

    Deviations on the page are taken at `start`; `unit` is what a unit of its page is in `q` (see `parts`).
    """

    def __init__(
        self, observed: PageObservations, start: DevelopableSurface, p: FittingParameters, unit: float = 1.0
    ) -> None:
        self.observed, self.lines, self.p = observed, observed.lines, p
        lines = observed.lines
        self.major_deviation = np.sqrt(FLOW_OVERLAP / np.maximum(observed.major.weights, 0.05)) * MAJOR_RAD
        self.major_deviation *= p.major_factor
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
            J = start.jacobians(lines.points)
            grow = unit * np.linalg.norm(J[:, 1], axis=1)
        self.line_deviation = lines.deviations * p.line_factor * np.maximum(grow, 1e-6)
        self.text_height = lines.text_height * (float(np.median(grow)) if len(grow) else 1.0)
        self.edges = StraightEdges(observed.edges, start, p, unit)

    def parts(self, q: Points, dq: Floats, slant: float, slant_at: int) -> dict[str, Residual]:
        """Residuals of `major`, `minor`, `straight`, `spacing`, `margins`, `sides` before any loss.

        `q` (N, 2) are the points on the page, `dq` (N, 2, M) their derivatives; parameter `slant_at` is the type's
        slant.
        """
        e = self.ends
        major = _direction(q, dq, slice(0, e[0]), slice(e[0], e[1]), 1)
        minor = _direction(q, dq, slice(e[1], e[2]), slice(e[2], e[3]), 0)
        minor.value[:] -= slant
        minor.slope[:, slant_at] -= 1.0
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
            "sides": self.edges.residual(q[e[6] :], dq[e[6] :]),
        }

    def under_losses(self, parts: Mapping[str, Residual]) -> list[Residual]:
        """The `parts` under their losses: single observations may be outliers, and groups be wrong as a whole."""
        of_flows = cauchy if self.p.cauchy_flows else soft_l1
        losses = {"major": of_flows, "minor": of_flows, "straight": soft_l1}
        losses |= {"spacing": cauchy, "margins": cauchy, "sides": cauchy}
        return [under(loss, parts[name]) for name, loss in losses.items()]

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
            deviation = np.hypot(p.spacing, p.spacing * np.sqrt(12.0) / weight**1.5)
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
