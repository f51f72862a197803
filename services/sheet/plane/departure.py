"""How far the print in a photo departs from that of a flat page seen without perspective.

Where the photo is the page itself, but for a turn, text lines are straight and parallel, and so are strokes. What a
slight perspective changes follows from its homography near the identity,

    x' = x / (1 + a x + b y),  y' = y / (1 + a x + b y),

with x, y along and across the lines from the middle of the photo. To first order in a and b

    dy'/dx' = -a y  on a line of text,  dx'/dy' = -b x  on a stroke,

so `a` is the convergence of the lines and `b` that of the strokes: how much the directions change over half of the
photo's width. The best affine map leaves of them displacements of about a (x - mean x) (y - mean y), and of b likewise.
Their RMS over the print is what matters: sparse print in the upper half of a letter shows a large convergence where a
corner of the paper is lifted a little. A bend adds curves that straight lines cannot follow.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector
from services.geometry.photo_frame import PhotoFrame
from services.robust import CAUCHY_WIDTH, REWEIGHTED_FITS, cauchy_weights, robust_scale
from services.sheet.developable.observations import LineObservations
from services.texture_flow.field import FlowSamples, angle_difference
from services.texture_flow.minor import blur_of_strokes

BEND_TERMS = 5
"""Of each polynomial of a bend: a page of a book bends within a tenth of its width."""
BEND_UNKNOWNS = 2 + 2 * BEND_TERMS
"""With a level of each line. Fewer points are fitted too well to show their own noise, or a turn."""
BEND_DEVIATION = 0.02
"""Standard deviation of their coefficients before anything is seen, in halves of the photo's width."""
FEWEST_POINTS = 8
"""On lines of two points or more; fewer show neither convergence nor a bend."""
FEWEST_DIRECTIONS = 20
"""Fewer are fitted too well by three unknowns to show their own noise."""
NARROW = 0.6
"""Of the photo's width: print that takes less is part of a page that is narrower too, ..."""
ENDS = (5.0, 95.0)
"""... between these percentiles of its characters."""


@dataclass(frozen=True, slots=True)
class Measured:
    """A value and its standard deviation."""

    value: float
    deviation: float

    def scaled(self, factor: float) -> "Measured":
        """The same in another unit."""
        return Measured(factor * self.value, abs(factor) * self.deviation)


@dataclass(frozen=True, slots=True)
class Departure:
    """Departure of a photo's print from a flat page without perspective; None for what too little print shows.

    `skew_rad` turns the photo's x axis onto them. The others are RMS displacements of the print, as shares of the
    photo's width, or of that of a narrower page: by the perspective that lines show, by that of strokes, by a bend.
    """

    skew_rad: float
    by_lines: Measured | None
    by_strokes: Measured | None
    by_bend: Measured | None


def measure_departure(
    lines: LineObservations,
    strokes: FlowSamples | None,
    characters: Points,
    view: PhotoFrame,
    skew_rad: float,
    text_height_px: float,
) -> Departure:
    """Departure of `lines`, traced in the photo turned by `skew_rad`, and of `strokes`.

    These and `characters` (N, 2) are centred in `view`; `text_height_px` is the characters' size in the photo.
    """
    axes = _axes(view, skew_rad)
    blur = blur_of_strokes(text_height_px)
    reach = _reach(characters, view, skew_rad)
    crossing = None
    if strokes is not None and len(strokes) >= FEWEST_DIRECTIONS:
        found = _convergence(strokes.points @ axes, strokes, skew_rad + np.pi / 2, 0)
        crossing = Measured(found.value, blur * found.deviation).scaled(reach)
    used = np.bincount(lines.index)[lines.index] > 1 if len(lines.index) else np.zeros(0, bool)
    if used.sum() < FEWEST_POINTS:
        return Departure(skew_rad, None, crossing, None)
    turn, along, bend = _line_departure(lines.points[used] @ axes, lines.index[used], lines.deviations[used])
    if used.sum() - len(np.unique(lines.index[used])) <= BEND_UNKNOWNS:
        return Departure(skew_rad, along.scaled(reach), crossing, None)
    bend = bend.scaled(_narrowness(characters @ axes))
    return Departure(skew_rad + turn, along.scaled(reach), crossing, bend)


def perspective_by_flow(
    flow: FlowSamples, characters: Points, view: PhotoFrame, skew_rad: float
) -> Measured | None:
    """`by_lines` of a `Departure` by the directions of the text alone, which are near `skew_rad`; None for few."""
    if len(flow) < FEWEST_DIRECTIONS:
        return None
    found = _convergence(flow.points @ _axes(view, skew_rad), flow, skew_rad, 1)
    return found.scaled(-_reach(characters, view, skew_rad))


def _reach(characters: Points, view: PhotoFrame, skew_rad: float) -> float:
    """RMS displacement of the `characters` (N, 2), as a share of the page's width, for a convergence of 1."""
    at = characters @ _axes(view, skew_rad)
    x, y = (at - at.mean(axis=0)).T
    # Halves of the width become shares of it.
    return 0.5 * float(np.sqrt(np.mean((x * y) ** 2))) * _narrowness(at)


def _narrowness(at: Points) -> float:
    """Width of the photo over that of the page, by its characters `at` (N, 2) in halves of the photo's width."""
    first, last = np.percentile(at[:, 0], ENDS)
    return max(1.0, 2 * NARROW / max(float(last - first), 1e-6))


def _axes(view: PhotoFrame, skew_rad: float) -> Floats:
    """From centred points (as rows) to places along and across lines at `skew_rad`, in halves of the photo's width."""
    c, s = np.cos(skew_rad), np.sin(skew_rad)
    return np.array([[c, -s], [s, c]]) / (0.5 * view.width / view.unit_px)


def _line_departure(
    at: Points, index: NDArray[np.intp], deviations: Vector
) -> tuple[float, Measured, Measured]:
    """Slope (rad), convergence, and displacement by a bend, from points `at` (N, 2) of lines.

    `index` (N,) is the line of each point; all is in halves of the photo's width. On line k

        y = c_k + s x - a x y + f(x) + y g(x),

    with polynomials f and g of no constant and linear terms: those of a bend.
    """
    weights = 1 / deviations
    share = weights**2 / np.bincount(index, weights**2)[index]

    def from_line(values: Floats) -> Floats:
        """`values` (N, P) less their means on each line, so that no c_k is left."""
        means = [np.bincount(index, share * column)[index] for column in values.T]
        return np.asarray(values - np.stack(means, axis=1))

    x, y = at.T
    level, straight, bent = from_line(at[:, 1:])[:, 0], np.stack([x, -x * y], axis=1), _bends(at)
    (turn, along), covariance = _fit(from_line(straight), level, weights)
    perspective = Measured(float(along), float(np.sqrt(covariance[1, 1])))
    found, covariance = _fit(from_line(np.column_stack([straight, bent])), level, weights, prior=2)
    # What straight lines leave of the bend where lines are. Its noise is taken away.
    rest = _beyond_straight(bent, at)
    noise = float(np.sqrt(np.mean(np.einsum("ni,ij,nj->n", rest, covariance[2:, 2:], rest))))
    size = float(np.sqrt(np.mean((rest @ found[2:]) ** 2)))
    # Halves of the width become shares of it.
    by_bend = Measured(float(np.sqrt(max(size**2 - noise**2, 0.0))), noise).scaled(0.5)
    return float(turn), perspective, by_bend


def _bends(at: Points) -> Floats:
    """Chebyshev polynomials (N, 2 BEND_TERMS) in x at places (N, 2), alone and times y."""
    x, y = at.T
    reach = max(float(np.abs(x).max()), 1e-9)
    along = np.polynomial.chebyshev.chebvander(x / reach, BEND_TERMS + 1)[:, 2:]
    return np.column_stack([along, along * y[:, None]])


def _beyond_straight(values: Floats, at: Points) -> Floats:
    """`values` (N, P) less what an affine map and a perspective explain at the places (N, 2).

    Where lines take a part of the width, curves are nearly straight there: a convergence may undo them.
    """
    straight = np.column_stack([np.ones(len(at)), at, at.prod(axis=1)])
    return np.asarray(values - straight @ np.linalg.lstsq(straight, values, rcond=None)[0])


def _convergence(at: Points, samples: FlowSamples, mean_rad: float, across: int) -> Measured:
    """How the directions of `samples` at points `at` (N, 2) change along the axis `across` them, about `mean_rad`.

    Along themselves they may change too, by a bend. Slanted type leans the same all over.
    """
    off = angle_difference(samples.angles, mean_rad)
    found, covariance = _fit(np.column_stack([np.ones(len(at)), at]), off, np.sqrt(samples.weights))
    return Measured(float(found[1 + across]), float(np.sqrt(covariance[1 + across, 1 + across])))


def _fit(terms: Floats, values: Vector, weights: Vector, prior: int | None = None) -> tuple[Vector, Floats]:
    """Coefficients (P,) of `terms` (N, P) for `values` (N,) under Cauchy's loss, and their covariance (P, P).

    Those from number `prior` on have a prior of `BEND_DEVIATION`: short lines do not show all of them.
    """
    held = np.zeros(terms.shape[1])
    if prior is not None:
        held[prior:] = BEND_DEVIATION**-2
    found: Vector = np.zeros(terms.shape[1])
    scale = np.inf
    for _ in range(REWEIGHTED_FITS):
        rest = weights * (values - terms @ found)
        loss = np.ones(len(rest)) if np.isinf(scale) else cauchy_weights(rest, CAUCHY_WIDTH * scale)
        weighted = terms * (weights**2 * loss)[:, None]
        unit = 1.0 if np.isinf(scale) else scale**2
        information = terms.T @ weighted + np.diag(held * unit)
        found = np.asarray(np.linalg.lstsq(information, weighted.T @ values, rcond=None)[0])
        rest = weights * (values - terms @ found)
        scale = max(robust_scale(rest), 1e-9)
    information = (terms * weights[:, None]).T @ (terms * weights[:, None]) / scale**2 + np.diag(held)
    return found, np.asarray(np.linalg.pinv(information))
