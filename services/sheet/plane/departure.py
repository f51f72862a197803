"""How far the print in a photo departs from that of a flat page seen without perspective.

Where the photo is the page itself, but for a turn, text lines are straight and parallel, and so are strokes. What a
slight perspective changes follows from its homography near the identity,

    x' = x / (1 + a x + b y),  y' = y / (1 + a x + b y),

with x, y along and across the lines from the middle of the photo. To first order in a and b

    dy'/dx' = -a y  on a line of text,  dx'/dy' = -b x  on a stroke,

so `a` is the convergence of the lines and `b` that of the strokes: how much the directions change over half of the
photo's width. A bend adds curves that straight lines cannot follow.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector
from services.geometry.photo_frame import PhotoFrame
from services.order_statistics import median
from services.robust import cauchy_weights
from services.sheet.developable.observations import LineObservations
from services.texture_flow.field import FlowSamples, angle_difference

ROUNDS = 8
"""Of reweighted least squares."""
LOSS_SCALE = 2.0
"""Scale of Cauchy's loss in robust deviations of the residuals."""
STRAY_SHARE = 0.05
"""Of the points of lines, the farthest from their lines, which are left out of the bend."""
FEWEST_POINTS = 8
"""On lines of two points or more; fewer show neither convergence nor a bend."""
FEWEST_STROKES = 8
SHARP_TEXT_HEIGHT_PX = 22.0
"""Below this size of characters in the photo, errors of stroke directions grow by the square of the ratio."""


@dataclass(frozen=True, slots=True)
class Measured:
    """A value and its standard deviation."""

    value: float
    deviation: float


@dataclass(frozen=True, slots=True)
class Departure:
    """Departure of a photo's print from a flat page without perspective; None for what too little print shows.

    `lines` counts the text lines. `skew_rad` turns the photo's x axis onto them. Convergences are in rad over half of
    the photo's width, `bend` is the RMS distance of the lines from straight ones that a bend explains, as a share of
    the photo's width.
    """

    lines: int
    skew_rad: float
    line_convergence: Measured | None
    stroke_convergence: Measured | None
    bend: float | None


def measure_departure(
    lines: LineObservations,
    strokes: FlowSamples | None,
    view: PhotoFrame,
    skew_rad: float,
    text_height_px: float,
) -> Departure:
    """Departure of `lines`, traced in the photo turned by `skew_rad`, and of `strokes`, both centred in `view`.

    `text_height_px` is the size of characters in the photo.
    """
    axes = _axes(view, skew_rad)
    blur = max(1.0, (SHARP_TEXT_HEIGHT_PX / text_height_px) ** 2)
    crossing = None
    if strokes is not None and len(strokes) >= FEWEST_STROKES:
        found = _convergence(strokes.points @ axes, strokes, skew_rad + np.pi / 2, 0)
        crossing = Measured(found.value, blur * found.deviation)
    used = np.bincount(lines.index)[lines.index] > 1 if len(lines.index) else np.zeros(0, bool)
    if used.sum() < FEWEST_POINTS:
        return Departure(lines.count // 2, skew_rad, None, crossing, None)
    turn, along, bend = _line_departure(lines.points[used] @ axes, lines.index[used], lines.deviations[used])
    return Departure(lines.count // 2, skew_rad + turn, along, crossing, bend)


def flow_convergence(lines: FlowSamples, view: PhotoFrame, skew_rad: float) -> Measured:
    """Convergence of text lines by their directions alone, which are centred in `view` and near `skew_rad`."""
    found = _convergence(lines.points @ _axes(view, skew_rad), lines, skew_rad, 1)
    return Measured(-found.value, found.deviation)


def _axes(view: PhotoFrame, skew_rad: float) -> Floats:
    """From centred points (as rows) to places along and across lines at `skew_rad`, in halves of the photo's width."""
    c, s = np.cos(skew_rad), np.sin(skew_rad)
    return np.array([[c, -s], [s, c]]) / (0.5 * view.width / view.unit_px)


def _line_departure(at: Points, index: NDArray[np.intp], deviations: Vector) -> tuple[float, Measured, float]:
    """Slope (rad), convergence and bend of lines through the points `at` (N, 2) in halves of the photo's width.

    `index` (N,) is the line of each point. On line k

        y = c_k + s x - a x y + (p x^2 + q x^3 + r x^2 y),

    the last three terms being those of a bend.
    """
    x, y = at.T
    weights = 1 / deviations
    share = weights**2 / np.bincount(index, weights**2)[index]

    def from_line(values: Vector) -> Vector:
        """`values` (N,) less their mean on each line, so that no c_k is left."""
        return np.asarray(values - np.bincount(index, share * values)[index])

    level = from_line(y)
    straight = np.stack([from_line(x), -from_line(x * y)], axis=1)
    bent = np.column_stack([straight, *(from_line(term) for term in (x * x, x**3, x * x * y))])
    (turn, along), spread = _fit(straight, level, weights)
    rest = [_rms(level - terms @ _fit(terms, level, weights)[0]) for terms in (straight, bent)]
    # Halves of the width become shares of it.
    bend = 0.5 * float(np.sqrt(max(rest[0] ** 2 - rest[1] ** 2, 0.0)))
    return float(turn), Measured(float(along), float(spread[1])), bend


def _convergence(at: Points, samples: FlowSamples, mean_rad: float, across: int) -> Measured:
    """How the directions of `samples` at points `at` (N, 2) change along the axis `across` them, about `mean_rad`.

    Along themselves they may change too, by a bend. Slanted type leans the same all over.
    """
    off = angle_difference(samples.angles, mean_rad)
    found, spread = _fit(np.column_stack([np.ones(len(at)), at]), off, np.sqrt(samples.weights))
    return Measured(float(found[1 + across]), float(spread[1 + across]))


def _fit(terms: Floats, values: Vector, weights: Vector) -> tuple[Vector, Vector]:
    """Coefficients (P,) of `terms` (N, P) for `values` (N,) under Cauchy's loss, and their standard deviations."""
    found: Vector = np.zeros(terms.shape[1])
    scale = np.inf
    for _ in range(ROUNDS):
        rest = weights * (values - terms @ found)
        loss = np.ones(len(rest)) if np.isinf(scale) else np.sqrt(cauchy_weights(rest, LOSS_SCALE * scale))
        found = np.linalg.lstsq(terms * (weights * loss)[:, None], values * weights * loss, rcond=None)[0]
        rest = weights * (values - terms @ found)
        scale = max(1.4826 * median(np.abs(rest)), 1e-9)
    covariance = np.linalg.pinv((terms * weights[:, None]).T @ (terms * weights[:, None])) * scale**2
    return np.asarray(found), np.asarray(np.sqrt(np.diag(covariance)))


def _rms(rest: Vector) -> float:
    """RMS of `rest` (N,) without the largest ones."""
    ordered = np.sort(np.abs(rest))
    return float(np.sqrt(np.mean(ordered[: max(int((1 - STRAY_SHARE) * len(ordered)), 1)] ** 2)))
