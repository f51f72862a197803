"""Vanishing points of rulings from the spacing of text lines (dissertation 3.3.4).

Text lines of a paragraph are equally spaced on the page, so along a projected ruling the places p_k of their tops
are a projective function of k. With w the inverse of the vanishing point's place (w = 0: at infinity), the map

    u(p) = p / (1 - w p)

sends the vanishing point to infinity, and u_k = a + b k. The text solves X v = Y, which weighs noise by the size
of v and fails at infinity; here w is fitted to all lines of all paragraphs at once, residuals measured where the
noise is: in the places p.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.dissertation_chain.rulings.line_profiles import LineEdges
from benchmarks.dissertation_chain.rulings.results import RulingVanishingPoints
from services.arrays import Points, Vector
from services.robust import cauchy_weights, robust_scale


@dataclass(frozen=True, slots=True)
class SpacingParameters:
    """How lines are grouped and fitted."""

    cross_ratio_error: float = 0.045
    """Bound on the difference of a cross ratio from 1/4: twice what the edges' noise makes."""
    same_leading: float = 0.03
    """Paragraphs whose spacing differs by more than this share have less and less say."""
    least_noise: float = 0.02
    """Noise of an edge over the line spacing, at least."""
    whole_line: float = 0.17
    """A gap that is so near to a whole number of lines (over the spacing) goes on with the paragraph."""
    most_missing: int = 3
    min_lines: int = 4
    min_edges: int = 10
    """Tops and bottoms of paragraphs on one ruling."""
    max_bend: float = 0.8
    """|w| times the reach of the lines: the vanishing point lies outside of the text."""
    iterations: int = 12
    floor_rad: float = np.deg2rad(0.3)
    """What the paths and the ruling itself add to the deviation of a vanishing point; neighbours have it in common."""
    most_rad: float = np.deg2rad(20.0)
    """A larger deviation means that nothing is known."""
    neighbours: float = 2.0
    """Deviation, in rulings, of the weights by which neighbours share evidence."""


@dataclass(frozen=True, slots=True, eq=False)
class SpacingFit:
    """w (1 / unit) with its standard deviation (infinite: unknown) and the number of edges used."""

    inverse_place: float
    deviation: float
    edges: int


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """Edges at `places` (E,), the `index` (E,) of each in its paragraph, and the `paragraph` (E,) it belongs to."""

    places: Vector
    index: Vector
    paragraph: NDArray[np.intp]


def estimate_ruling_vanishing_points(
    edges: list[LineEdges], points: Points, angles: Vector
) -> RulingVanishingPoints:
    """Vanishing points of the rulings through `points` (N, 2) at `angles` (N,), from the `edges` along each.

    Places are counted from the points, along the angles, in centred unit coordinates.
    """
    p = SpacingParameters()
    fits = [fit_line_spacing(e, p) for e in edges]
    along = np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=1)
    at = np.column_stack([points, np.ones(len(points))])
    w = np.array([fit.inverse_place for fit in fits])
    direction = along + w[:, None] * at
    length = np.linalg.norm(direction, axis=1)
    # d(direction) / dw, less its part along the direction: how far the ray turns.
    unit = direction / length[:, None]
    turn = at - np.einsum("nx,nx->n", at, unit)[:, None] * unit
    deviation = np.array([fit.deviation for fit in fits]) * np.linalg.norm(turn, axis=1) / length
    deviation = np.hypot(deviation, p.floor_rad)
    return share_with_neighbours(RulingVanishingPoints(unit, deviation), points, angles, p)


def find_paragraphs(places: Vector, error: float) -> list[Vector]:
    """Runs of consecutive lines at `places` (T,), any four of which have the cross ratio 1/4 (Equation 3.7)."""
    if len(places) < 4:
        return []
    d = np.diff(places)
    ratio = d[:-2] * d[2:] / np.maximum((d[:-2] + d[1:-1]) * (d[1:-1] + d[2:]), 1e-18)
    # Equal gaps and a paragraph's space on both sides of one line have nearly the same ratio: gaps must agree, too.
    even = np.maximum(d[:-1], d[1:]) < 1.22 * np.minimum(d[:-1], d[1:])
    good = (np.abs(ratio - 0.25) < error) & even[:-1] & even[1:]
    inside = np.zeros(len(d), bool)
    for k in range(3):
        inside[k : k + len(good)] |= good
    ends = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8)))
    return [places[a : b + 1] for a, b in ends.reshape(-1, 2)]


def fit_line_spacing(edges: LineEdges, parameters: SpacingParameters | None = None) -> SpacingFit:
    """w of one ruling by robust least squares over all paragraphs, tops and bottoms together.

    Unknown are w, one spacing b for all paragraphs - most pages keep their leading, and then the spacing at the head
    of the page against that at its foot says most - and each one's start a. Paragraphs of another leading, and single
    edges that are off, lose their weight (Cauchy).
    """
    p = parameters or SpacingParameters()
    sides = (edges.tops, edges.bottoms)
    runs = [run for side in sides for run in find_paragraphs(side, p.cross_ratio_error)]
    if sum(len(run) for run in runs) < p.min_edges:
        return SpacingFit(0.0, float("inf"), 0)
    bound = p.max_bend / max(float(np.abs(np.concatenate(runs)).max()), 1e-9)
    w, b = _start(runs, bound)
    deviation, edge_count = float("inf"), 0
    for _ in range(p.iterations):
        lines = _group_lines(sides, w, b, p)
        edge_count = len(lines.places)
        if edge_count < p.min_edges:
            return SpacingFit(0.0, float("inf"), 0)
        w_next, b, deviation = _step(lines, w, p)
        w_next = float(np.clip(w_next, -bound, bound))
        settled = abs(w_next - w) < 1e-6
        w = w_next
        if settled:
            break
    return SpacingFit(w, deviation if abs(w) < bound else float("inf"), edge_count)


def _group_lines(sides: tuple[Vector, Vector], w: float, b: float, p: SpacingParameters) -> _Lines:
    """Lines numbered by what is known of w and the spacing `b`: a gap of whole lines goes on with the paragraph."""
    places, index, paragraph = [], [], []
    count = 0
    for found in sides:
        side = found[w * found < p.max_bend]
        gap = np.diff(side / (1 - w * side)) / b
        lines = np.round(gap)
        joined = (np.abs(gap - lines) < p.whole_line) & (lines >= 1) & (lines <= p.most_missing)
        group = np.concatenate([[0], np.cumsum(~joined)]) if len(side) else np.zeros(0, np.intp)
        number = np.concatenate([[0.0], np.cumsum(np.where(joined, lines, 0.0))])[: len(side)]
        members = np.bincount(group, minlength=1)
        kept = members[group] >= p.min_lines
        places.append(side[kept])
        index.append(number[kept])
        renamed = np.cumsum(members >= p.min_lines) - 1
        paragraph.append(count + renamed[group[kept]])
        count += int((members >= p.min_lines).sum())
    k, group = np.concatenate(index), np.concatenate(paragraph).astype(np.intp)
    # Numbers near zero, for the sake of the normal equations.
    mean = np.bincount(group, k) / np.maximum(np.bincount(group), 1)
    return _Lines(np.concatenate(places), k - mean[group], group)


def _start(runs: list[Vector], bound: float, agreement: float = 0.06) -> tuple[float, float]:
    """w and the spacing b from the gaps alone, by trial: with the true w, most gaps in u are one and the same.

    A fit by least squares would take a heading or a footnote of another leading, at the end of the page where it has
    most leverage, for perspective.
    """
    before = np.concatenate([run[:-1] for run in runs])
    after = np.concatenate([run[1:] for run in runs])
    trials = np.linspace(-bound, bound, 81)[:, None]
    gap = (after - before) / ((1 - trials * before) * (1 - trials * after))
    common = np.median(gap, axis=1, keepdims=True)
    for _ in range(2):
        weight = cauchy_weights(gap / common - 1, agreement)
        common = (weight * gap).sum(axis=1, keepdims=True) / weight.sum(axis=1, keepdims=True)
    best = int(np.argmax(cauchy_weights(gap / common - 1, agreement).sum(axis=1)))
    return float(trials[best, 0]), float(common[best, 0])


def _step(lines: _Lines, w: float, p: SpacingParameters) -> tuple[float, float, float]:
    """One step of Gauss and Newton from `w`, by reweighted least squares: new w, spacing b, deviation of w."""
    at, k, group = lines.places, lines.index, lines.paragraph
    shrink = 1 - w * at
    u, du = at / shrink, (at / shrink) ** 2
    # An error of the place moves u by 1 / shrink^2.
    precision = shrink**4
    own = _slopes(u, k, precision, group)
    b = _weighted_median(own, np.asarray(np.bincount(group, precision * k**2), np.float64))
    weight = precision * cauchy_weights(own / b - 1, p.same_leading)[group]
    for _ in range(3):
        columns = np.stack([_centred(du, weight, group), _centred(-k, weight, group)], axis=1)
        target = _centred(u, weight, group)
        normal = columns.T @ (weight[:, None] * columns)
        normal[np.arange(2), np.arange(2)] *= 1 + 1e-9
        change, spacing = -np.linalg.solve(normal + 1e-18 * np.eye(2), columns.T @ (weight * target))
        r = (target + columns @ np.array([change, spacing])) * shrink**2
        b = max(float(spacing), 1e-9)
        noise = max(robust_scale(r), p.least_noise * b)
        weight = precision * cauchy_weights(own / b - 1, p.same_leading)[group] * cauchy_weights(r, 2 * noise)
    # The normal matrix counts weights of precision; an edge's own variance is noise^2.
    variance = float(np.linalg.inv(normal + 1e-18 * np.eye(2))[0, 0]) * noise**2
    return w + float(change), b, float(np.sqrt(max(variance, 0.0)))


def _slopes(u: Vector, k: Vector, weight: Vector, group: NDArray[np.intp]) -> Vector:
    """Spacing of every paragraph by itself."""
    centred = _centred(k, weight, group)
    return np.bincount(group, weight * centred * u) / np.maximum(
        np.bincount(group, weight * centred**2), 1e-18
    )


def _centred(values: Vector, weight: Vector, group: NDArray[np.intp]) -> Vector:
    """`values` less the weighted mean of each paragraph: its start drops out."""
    mean = np.bincount(group, weight * values) / np.maximum(np.bincount(group, weight), 1e-18)
    return np.asarray(values - mean[group])


def _weighted_median(values: Vector, weights: Vector) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def share_with_neighbours(
    found: RulingVanishingPoints, points: Points, angles: Vector, p: SpacingParameters
) -> RulingVanishingPoints:
    """Each vanishing point averaged with its neighbours', by deviation and distance, and put back on its ruling.

    Rulings of a page turn slowly in space, so that neighbours see nearly the same point; one that none of them
    agrees with (a few lines of mixed spacing can be fitted by chance) loses its weight, and takes theirs.
    """
    known = np.isfinite(found.deviations)
    if not known.any():
        return found
    deviation = np.where(known, found.deviations, 1.0)
    near = np.exp(-0.5 * ((np.arange(len(known))[:, None] - np.arange(len(known))) / p.neighbours) ** 2)
    normal = np.stack(
        [-np.sin(angles), np.cos(angles), points[:, 0] * np.sin(angles) - points[:, 1] * np.cos(angles)],
        axis=1,
    )
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    # A homogeneous direction has no sign of its own: all follow the best known.
    best = found.directions[int(np.argmin(np.where(known, deviation, np.inf)))]
    signed = found.directions * np.where(found.directions @ best < 0, -1.0, 1.0)[:, None]
    trust = np.where(known, 1.0, 0.0)
    for _ in range(4):
        weights = near * (trust / deviation**2)
        total = weights.sum(axis=1)
        mean = weights @ signed / np.maximum(total, 1e-300)[:, None]
        mean -= np.einsum("nx,nx->n", mean, normal)[:, None] * normal
        length = np.linalg.norm(mean, axis=1)
        mean /= np.maximum(length, 1e-12)[:, None]
        off = np.linalg.norm(np.cross(mean, signed), axis=1)
        trust = np.where(known, cauchy_weights(off, 3 * deviation), 0.0)
    shared = (total > 0) & (length > 1e-6)
    directions = np.where(shared[:, None], mean, found.directions)
    own = np.hypot(np.sqrt(1 / np.maximum(total, 1e-300)), p.floor_rad)
    return RulingVanishingPoints(directions, np.where(shared & (own < p.most_rad), own, np.inf))
