"""The frontal flat view of a page of planar strips (dissertation 3.3.6)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from benchmarks.dissertation_chain.strips.constraints import lines_of_sight, sample_shares, tangents, unit
from benchmarks.dissertation_chain.strips.evidence import StripEvidence
from benchmarks.dissertation_chain.strips.strip_map import StripMap
from services.arrays import Floats, Homography, Points, Vector
from services.geometry.homographies import denominators, transform_points

_LEAST_TRUST = 1e-3
"""Weight of a strip without text in the mean of the rows."""
_LEAST_WIDTH = 0.05
"""Of a strip, over the usual one."""
_LEAST_STEEPNESS = 0.1
"""Sine of the angle between a ruling and the rows, at least: a ruling along the text lines crosses no row."""

_LEAST_DEPTH = 0.1
"""Of a row's points, over the least depth of a reference point: nearer the camera, nothing is a page."""
_NEAREST = 0.4
"""Depth to which the page is continued towards the camera, over the depth of its border."""
_LEAST_ROWS = 4
"""A cubic spline needs them."""


@dataclass(frozen=True, slots=True)
class ViewParameters:
    """The control grid."""

    curves: int = 21
    """Rows of control points."""
    margin: float = 0.25
    """How far the map goes beyond the text, on every side, in widths or heights of the text."""
    margin_columns: int = 6
    columns_per_strip: float = 1.5
    least_cosine: float = 0.08
    """Between a strip's normal and its line of sight: whatever is seen is seen from the front."""


@dataclass(frozen=True, slots=True, eq=False)
class StripChain:
    """Strips joined at their reference points.

    `H_centred_page` (L, 3, 3) are the homographies of Equation 3.4, `H_page_centred` their inverses;
    `points` (L + 1, 3) are the reference points in space, `page_points` (L + 1, 2) on the page.
    """

    H_centred_page: Floats
    H_page_centred: Floats
    points: Floats
    page_points: Points


def chain_strips(
    evidence: StripEvidence, normals: Floats, focal: float, least_cosine: float = 0.08
) -> StripChain:
    """Homographies of all strips, each continuing the page where the one before it ends (3.3.6).

    The depth of P_1 is f, so that the page's unit is that of the photo there. P_{i+1} lies on its line of sight and on
    strip i: the 3 x 3 system of 3.3.6 in closed form.
    """
    sight = lines_of_sight(evidence.reference_points, focal)
    normals = facing(normals, unit(sight[1:] + sight[:-1]), least_cosine)
    T = unit(mean_major_flow(evidence, normals, focal))
    B = np.cross(normals, T)
    K = np.diag([focal, focal, 1.0])
    count = evidence.count
    P, page = np.zeros((count + 1, 3)), np.zeros((count + 1, 2))
    forward, backward = np.zeros((count, 3, 3)), np.zeros((count, 3, 3))
    P[0] = sight[0]
    for i in range(count):
        floor = least_cosine / 2 * np.linalg.norm(sight[i : i + 2], axis=1)
        here, there = np.maximum(sight[i : i + 2] @ normals[i], floor)
        P[i + 1] = sight[i + 1] * (here * P[i, 2] / focal / there)
        shift = np.array([[1.0, 0.0, -page[i, 0]], [0.0, 1.0, -page[i, 1]], [0.0, 0.0, 1.0]])
        forward[i] = K @ np.column_stack([T[i], B[i], P[i]]) @ shift
        backward[i] = np.linalg.inv(forward[i])
        step = P[i + 1] - P[i]
        page[i + 1] = page[i] + [step @ T[i], step @ B[i]]
    return StripChain(forward, backward, P, page)


def facing(normals: Floats, sight: Floats, least_cosine: float) -> Floats:
    """Unit `normals` (L, 3); those across or against their unit lines of `sight` (L, 3) are leant towards them."""
    cosine = np.einsum("la,la->l", normals, sight)
    aside = unit(normals - cosine[:, None] * sight)
    leant = least_cosine * sight + np.sqrt(1 - least_cosine**2) * aside
    return np.asarray(np.where((cosine < least_cosine)[:, None], unit(leant), normals))


def mean_major_flow(evidence: StripEvidence, normals: Floats, focal: float) -> Floats:
    """Averages (L, 3) of T_ij in each strip."""
    T = tangents(evidence.major, evidence.points, normals[:, None], focal)
    return np.asarray(np.einsum("lj,lja->la", sample_shares(evidence), T))


def unroll_strips(
    evidence: StripEvidence,
    normals: Floats,
    focal: float,
    characters: Points,
    parameters: ViewParameters | None = None,
) -> StripMap | None:
    """Seamless map between page and photo through control points where curves C_j cross the rulings.

    The curves follow the mean major flow of every strip; each becomes a row of the page at the mean height of its
    pieces, and advances by the true width of every strip at its height. Rulings stay straight.
    None when the strips make no page: within the text, rows come out of order or go behind the camera.
    """
    p = parameters or ViewParameters()
    chain = chain_strips(evidence, normals, focal, p.least_cosine)
    low, high = _text_heights(evidence, chain, characters)
    margin = p.margin * (high - low)
    levels = np.linspace(low - margin, high + margin, p.curves)
    left, right = trace_rows(evidence, chain, levels)
    trust = evidence.major_weights.mean(axis=1) + _LEAST_TRUST
    rows = np.average((left[..., 1] + right[..., 1]) / 2, axis=0, weights=trust)
    text = (levels >= low) & (levels <= high)
    kept = _visible_rows(chain, left, right, rows)
    if not kept[text].all() or kept.sum() < _LEAST_ROWS:
        return None
    left, right, rows, text = left[:, kept], right[:, kept], rows[kept], text[kept]
    start = evidence.count // 2
    widths = np.concatenate([np.zeros((1, len(rows))), np.cumsum(right[..., 0] - left[..., 0], axis=0)])
    across = _in_order(_straight(widths - widths[start] + left[start, :, 0], rows, text))
    photo = np.stack([transform_points(H, q) for H, q in zip(chain.H_centred_page, left, strict=True)])
    last = transform_points(chain.H_centred_page[-1], right[-1])
    knots, values = _extend(chain, across, np.concatenate([photo, last[None]]), left[0], right[-1], p)
    columns = np.linspace(knots[0, 0], knots[0, -1], int(p.columns_per_strip * knots.shape[1]))
    lattice = np.stack([CubicSpline(k, v)(columns) for k, v in zip(knots, values, strict=True)])
    return StripMap(columns, rows, lattice)


def _visible_rows(chain: StripChain, left: Floats, right: Floats, rows: Vector) -> NDArray[np.bool_]:
    """The rows (J,) round the middle one that lie before the camera all along, and in order."""
    with np.errstate(invalid="ignore"):
        depths = np.stack(
            [
                denominators(H, q)
                for side in (left, right)
                for H, q in zip(chain.H_centred_page, side, strict=True)
            ]
        )
        good = np.all(np.isfinite(depths) & (depths > _LEAST_DEPTH * chain.points[:, 2].min()), axis=0)
        middle = len(rows) // 2
        good &= np.concatenate([np.diff(rows[: middle + 1]) > 0, [True], np.diff(rows[middle:]) > 0])
    kept = np.zeros(len(rows), bool)
    kept[middle:] = np.logical_and.accumulate(good[middle:])
    kept[: middle + 1] = np.logical_and.accumulate(good[middle::-1])[::-1]
    return kept


def trace_rows(evidence: StripEvidence, chain: StripChain, levels: Vector) -> tuple[Floats, Floats]:
    """Where rows that start at `levels` (J,) of the middle strip's left ruling enter and leave every strip.

    Two arrays (L, J, 2) in the strip's own rectification: q+ on the ruling at its left, q- on that at its right.
    """
    count = evidence.count
    left, right = np.empty((count, len(levels), 2)), np.empty((count, len(levels), 2))
    start = count // 2
    rulings = [[_ruling_on_page(evidence, chain, i, side) for i in range(count)] for side in (0, 1)]
    entered = np.column_stack([np.zeros_like(levels), levels])
    left[start] = _cross(entered, rulings[0][start])
    for i in range(start, count):
        right[i] = _cross(left[i], rulings[1][i])
        if i + 1 < count:
            seen = transform_points(chain.H_centred_page[i], right[i])
            left[i + 1] = transform_points(chain.H_page_centred[i + 1], seen)
    for i in range(start - 1, -1, -1):
        seen = transform_points(chain.H_centred_page[i + 1], left[i + 1])
        right[i] = transform_points(chain.H_page_centred[i], seen)
        left[i] = _cross(right[i], rulings[0][i])
    return left, right


def strips_of(evidence: StripEvidence, points: Points) -> NDArray[np.intp]:
    """The strip (N,) that each point lies in; those beside the page belong to the strip at its end."""
    offset = points[:, None] - evidence.reference_points[None]
    r = evidence.rulings
    right_of = r[:, 1] * offset[..., 0] - r[:, 0] * offset[..., 1] > 0
    return np.asarray(np.clip(right_of.sum(axis=1) - 1, 0, evidence.count - 1))


def _text_heights(evidence: StripEvidence, chain: StripChain, characters: Points) -> tuple[float, float]:
    """Highest and lowest text on the page."""
    places = characters if len(characters) else evidence.points.reshape(-1, 2)
    heights = np.empty(len(places))
    strips = strips_of(evidence, places)
    for i in np.unique(strips):
        chosen = strips == i
        heights[chosen] = transform_points(chain.H_page_centred[i], places[chosen])[:, 1]
    low, high = np.quantile(heights, [0.005, 0.995])
    return float(low), float(high)


def _cross(points: Points, line: tuple[Points, Floats]) -> Points:
    """Where horizontals through `points` (N, 2) meet a line (point and direction)."""
    place, direction = line
    share = (points[:, 1] - place[1]) / direction[1]
    return np.asarray(place + share[:, None] * direction)


def _ruling_on_page(
    evidence: StripEvidence, chain: StripChain, strip: int, side: int
) -> tuple[Points, Floats]:
    """A point and the unit direction of the ruling at the left (0) or right (1) of a strip, in its rectification."""
    ruling = strip + side
    p, r = evidence.reference_points[ruling], evidence.rulings[ruling]
    q = transform_points(chain.H_page_centred[strip], np.stack([p, p + 1e-3 * r]))
    d = unit(q[1] - q[0])
    d[1] = max(d[1], _LEAST_STEEPNESS)
    return q[0], d


def _straight(across: Floats, rows: Vector, chosen: NDArray[np.bool_]) -> Floats:
    """Rulings (L + 1, J) as straight lines over the page's `rows` (J,), fitted to the `chosen` ones."""
    design = np.column_stack([np.ones_like(rows), rows - rows.mean()])
    return np.asarray(across[:, chosen] @ np.linalg.pinv(design[chosen]).T @ design.T)


def _in_order(across: Floats) -> Floats:
    """Rulings (L + 1, J), left to right in every row: where they would cross, strips keep a little width."""
    widths = np.diff(across, axis=0)
    widths = np.maximum(widths, _LEAST_WIDTH * max(float(np.median(widths)), 1e-9))
    return np.concatenate([across[:1], across[:1] + np.cumsum(widths, axis=0)])


def _extend(
    chain: StripChain, across: Floats, photo: Floats, left: Points, right: Points, p: ViewParameters
) -> tuple[Floats, Floats]:
    """Knots (J, K) along every row and their photo points (J, K, 2), with those beside the text in the end strips."""
    margin = p.margin * float(np.median(across[-1] - across[0]))
    low = np.min(across[0]) - min(margin, _reach(chain.H_centred_page[0], left, -1.0))
    high = np.max(across[-1]) + min(margin, _reach(chain.H_centred_page[-1], right, 1.0))
    share = np.arange(1, p.margin_columns + 1)[:, None] / p.margin_columns
    before, after = (across[0] - (across[0] - low) * share)[::-1], across[-1] + (high - across[-1]) * share
    beside = left + np.stack([before - across[0], np.zeros_like(before)], axis=-1)
    beyond = right + np.stack([after - across[-1], np.zeros_like(after)], axis=-1)
    seen = [
        transform_points(H, places.reshape(-1, 2)).reshape(places.shape)
        for H, places in ((chain.H_centred_page[0], beside), (chain.H_centred_page[-1], beyond))
    ]
    knots = np.concatenate([before, across, after])
    return knots.T, np.concatenate([seen[0], photo, seen[1]]).transpose(1, 0, 2)


def _reach(H: Homography, edge: Points, side: float) -> float:
    """How far an end strip goes on along the rows beyond `edge` (N, 2) before it comes too near the camera."""
    approach = -side * float(H[2, 0])  # depth is linear along a row
    if approach <= 0:
        return np.inf
    return (1 - _NEAREST) * float(denominators(H, edge).min()) / approach
