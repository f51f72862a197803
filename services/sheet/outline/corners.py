"""Where the four sides of a closed curve meet."""

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector
from services.kernels.library import address, find_kernels
from services.order_statistics import median
from services.sheet.outline.edges import EdgePoints

# Lengths are shares of the curve's length unless stated.
CANDIDATES = 12
"""Turns of the curve that are tried as corners ..."""
RUNS = 4
"""... and pieces out of view, the longest ones, whose ends and middles are tried too."""
ARM = 0.035
"""The turn of the curve is measured over this length to either side."""
SHORTEST_SIDE = 0.05
LONGEST_SIDE = 0.6
SIDE_SAMPLES = 32
"""Points of a side that its parabola is fitted to."""
JAG = 0.1
"""Of the mean side: what a point's distance from its side counts for at most."""
TURN_WEIGHT = 0.02
"""What a corner that does not turn costs, as a mean square distance from the sides over the square of the
mean side."""
FIT_SHARE = 0.2
"""Of a side, next to a corner: its curve is fitted there ..."""
LINE_SHARE = 0.08
"""... or, where that is not smooth, a line to this share."""
SKIPPED = 0.025
"""Of a side, next to a corner: rounded, and left out."""
SMOOTH = 0.0012
"""Of a side: residual (RMS) up to which a piece of it counts as smooth."""
NOTCH = 0.005
"""Of a side: where the edge is further from a smooth side, the smooth side is tried too."""
KEPT = 0.7
"""Share of a piece that must be near its parabola."""
REACH = 0.06
"""Of the shorter side: a corner is no further from the seen curve (a folded corner)."""


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """`indices` (4,) where the curve of N points turns from side to side, and how well four sides describe it.

    `misfit` is the RMS distance of the seen points from smooth sides, as a share of the mean side's length;
    `turns_rad` (4,) are the turns of the curve at the corners.
    """

    indices: NDArray[np.intp]
    misfit: float
    turns_rad: Vector


def split_sides(points: Points, shown: NDArray[np.bool_]) -> Corners | None:
    """The four corners of a closed clockwise curve (N, 2): four smooth sides describe what is `shown` (N,) of it best.

    None if the curve does not turn in four places. A side that is out of the photo is not seen: the curve
    follows the photo's border there, and its ends, or its middle, replace the corners.
    """
    count = len(points)
    arm = max(int(ARM * count), 2)
    turn = _turns(points, arm)
    places = _places(turn, shown, arm)
    if len(places) < 4:
        return None
    cost = _side_costs(points, shown, places)
    fours = _fours(len(places))
    fits = np.asarray(cost[fours, np.roll(fours, -1, axis=1)].sum(axis=1) / count)
    flatness = np.clip(1 - turn[places] / np.deg2rad(70.0), 0, 1.5) ** 2
    price = np.where(shown[places], flatness, 0.1)
    total = fits + TURN_WEIGHT * price[fours].sum(axis=1)
    best = int(np.argmin(total))
    if not np.isfinite(total[best]):
        return None
    at = places[fours[best]]
    return Corners(np.asarray(at, np.intp), float(np.sqrt(fits[best])), turn[at])


@cache
def _fours(count: int) -> NDArray[np.intp]:
    """All choices (K, 4) of four of `count` places, in order; `count` is two dozen at most."""
    return np.array(list(itertools.combinations(range(count), 4)), np.intp)


def _turns(points: Points, arm: int) -> Vector:
    """(N,) signed turn of the curve at every point, over `arm` points to either side; clockwise is positive."""
    before = points - np.roll(points, arm, axis=0)
    after = np.roll(points, -arm, axis=0) - points
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(np.arctan2(cross, (before * after).sum(axis=1)))


def _places(turn: Vector, shown: NDArray[np.bool_], arm: int) -> NDArray[np.intp]:
    """Sorted indices where corners are tried: the strongest turns, and ends and middles of what is out of view."""
    count = len(turn)
    left = turn.copy()
    chosen: list[int] = []
    while len(chosen) < CANDIDATES:
        k = int(np.argmax(left))
        if left[k] < np.deg2rad(15.0):
            break
        chosen.append(k)
        left[np.arange(k - arm // 2, k + arm // 2 + 1) % count] = -1
    gone = ~shown
    if gone.any() and shown.any():
        starts = np.flatnonzero(gone & ~np.roll(gone, 1))
        ends = np.flatnonzero(gone & ~np.roll(gone, -1))
        lengths = np.array([int((ends - start).min(where=ends >= start, initial=count)) for start in starts])
        wrapped = lengths == count
        lengths[wrapped] = ends[0] + count - starts[wrapped]
        for k in np.argsort(-lengths)[:RUNS]:
            start, length = int(starts[k]), int(lengths[k])
            chosen += [start, (start + length // 2) % count, (start + length) % count]
    return np.asarray(sorted(set(chosen)), np.intp)


def _side_costs(curve: Points, shown: NDArray[np.bool_], places: NDArray[np.intp]) -> Floats:
    """(K, K) sum of squared distances of the shown points from place a to b from a parabola, over the squared side."""
    count = len(curve)
    unit = float(np.linalg.norm(np.ptp(curve, axis=0))) / 2
    lengths = (places[None, :] - places[:, None]) % count
    cost = np.full(lengths.shape, np.inf)
    a, b = np.nonzero((lengths >= SHORTEST_SIDE * count) & (lengths <= LONGEST_SIDE * count))
    cost[a, b] = piece_costs(curve / unit, shown, places[a], lengths[a, b])
    return cost


def piece_costs(
    curve: Points, shown: NDArray[np.bool_], starts: NDArray[np.intp], lengths: NDArray[np.intp]
) -> Vector:
    """(S,) sums of squared distances of the `shown` (N,) points of pieces of a closed `curve` (N, 2) from parabolas.

    Each begins at its point number `starts` (S,) and is `lengths` (S,) long. A distance counts `JAG` at most.
    """
    count, pieces = len(curve), len(starts)
    if shown.shape != (count,) or lengths.shape != (pieces,):
        raise ValueError("every piece has a beginning and a length, every point is shown or not")
    kernels = find_kernels()
    if kernels is None:
        return piece_costs_plain(curve, shown, starts, lengths)
    if pieces and not (0 <= starts.min() <= starts.max() < count and lengths.min() >= 0):
        raise IndexError("pieces begin at points of the curve")
    curve, shown = np.ascontiguousarray(curve, np.float64), np.ascontiguousarray(shown, bool)
    starts, lengths = (np.ascontiguousarray(given, np.intp) for given in (starts, lengths))
    share, costs = np.linspace(0, 1, SIDE_SAMPLES), np.empty(pieces)
    given = address(curve), address(shown), count, address(starts), address(lengths), pieces
    if not kernels.piece_costs(*given, address(share), SIDE_SAMPLES, JAG, address(costs)):
        raise MemoryError
    return costs


def piece_costs_plain(
    curve: Points, shown: NDArray[np.bool_], starts: NDArray[np.intp], lengths: NDArray[np.intp]
) -> Vector:
    """`piece_costs` without a kernel."""
    share = np.linspace(0, 1, SIDE_SAMPLES)
    index = (starts[:, None] + np.round(share * lengths[:, None]).astype(int)) % len(curve)
    weight = shown[index].astype(np.float64)
    total = np.maximum(weight.sum(axis=1), 1.0)
    points = curve[index]
    centred = points - (weight[..., None] * points).sum(axis=1, keepdims=True) / total[:, None, None]
    moment = np.einsum("sn,sni,snj->sij", weight, centred, centred)
    angle = 0.5 * np.arctan2(2 * moment[:, 0, 1], moment[:, 0, 0] - moment[:, 1, 1])
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    s = np.einsum("sni,si->sn", centred, way)
    d = centred[..., 1] * way[:, None, 0] - centred[..., 0] * way[:, None, 1]
    design = np.stack([np.ones_like(s), s, s * s], axis=2)
    weighted = design * weight[..., None]
    normal = np.einsum("sni,snj->sij", weighted, design) + 1e-6 * np.eye(3)
    fit = np.linalg.solve(normal, np.einsum("sni,sn->si", weighted, d)[..., None])[..., 0]
    # A few jags of creases are not a corner.
    residual = np.minimum(np.abs(d - np.einsum("sni,si->sn", design, fit)), JAG)
    return np.asarray((weight * residual**2).sum(axis=1) * lengths / SIDE_SAMPLES)


def locate_corners(edge: EdgePoints, corners: Corners) -> Points:
    """The corners (4, 2) of a closed edge: where both sides' local fits meet; NaN where that is not seen."""
    count = len(edge.points)
    sides = []
    for start, end in zip(corners.indices, np.roll(corners.indices, -1), strict=True):
        index = (start + np.arange(int(end - start) % count + 1)) % count
        sides.append((edge.points[index], edge.seen[index]))
    return _corners_of(sides, edge.shown[corners.indices])


def meet_sides(sides: list[EdgePoints], known: NDArray[np.bool_]) -> Points:
    """The corners (4, 2) of four measured sides, in order; NaN where not `known` or not seen."""
    return _corners_of([(side.points, side.seen) for side in sides], known)


def guide_sides(edge: EdgePoints, corners: Corners, located: Points) -> list[Points]:
    """Curves (N, 2) near the four sides: what was seen of them, straight on across the rest, and sharp corners."""
    count = len(edge.points)
    guides = []
    for k in range(4):
        start, end = int(corners.indices[k]), int(corners.indices[(k + 1) % 4])
        length = (end - start) % count
        known = np.isfinite(located[[k, (k + 1) % 4], 0])
        # Near a corner the closed curve is rounded.
        rounded = max(round(0.03 * length), 1)
        inner = np.arange(rounded if known[0] else 0, length - (rounded if known[1] else 0) + 1)
        index = (start + inner) % count
        # Beyond the photo's border there is nothing else to follow.
        kept = edge.seen[index] | ~edge.shown[index]
        ends = [0, -1]
        kept[ends] |= ~known
        pieces = [edge.points[index[kept]]]
        if known[0]:
            pieces.insert(0, located[k][None])
        if known[1]:
            pieces.append(located[(k + 1) % 4][None])
        guides.append(np.concatenate(pieces))
    return guides


def _corners_of(sides: list[tuple[Points, NDArray[np.bool_]]], known: NDArray[np.bool_]) -> Points:
    """Corner k (4, 2) lies between side k - 1 and side k, each a curve (N, 2) and where it is seen (N,)."""
    found = np.full((4, 2), np.nan)
    lengths = [float(np.linalg.norm(points[-1] - points[0])) for points, _ in sides]
    for k in np.flatnonzero(known):
        (before, before_seen), (after, after_seen) = sides[k - 1], sides[k]
        incoming = _end_line(before[::-1], before_seen[::-1])
        outgoing = _end_line(after, after_seen)
        if incoming is None or outgoing is None:
            continue
        crossing = meet(*incoming, *outgoing)
        end = 0.5 * (before[-1] + after[0])
        reach = REACH * min(lengths[k - 1], lengths[k])
        if crossing is not None and np.linalg.norm(crossing - end) <= reach:
            found[k] = crossing
    return found


def _end_line(points: Points, seen: NDArray[np.bool_]) -> tuple[Points, Points] | None:
    """Point and direction of a side's curve (N, 2) where it begins; None where it is not seen there."""
    count = len(points)
    skip = max(round(SKIPPED * count), 1)
    side = float(np.linalg.norm(points[-1] - points[0]))
    wide, narrow = (
        np.flatnonzero(seen[skip : max(round(share * count), skip + 6)]) + skip
        for share in (FIT_SHARE, LINE_SHARE)
    )
    if len(wide) >= 10:
        piece = points[wide]
        centre = piece.mean(axis=0)
        axes = np.linalg.svd(piece - centre, full_matrices=False)[2]
        s, d = (piece - centre) @ axes[0], (piece - centre) @ axes[1]
        unit = max(float(np.abs(s).max()), 1e-9)
        powers = np.array([1.0, unit, unit * unit])
        design = np.stack([np.ones_like(s), s / unit, (s / unit) ** 2], axis=1)
        keep = np.ones(len(s), bool)
        for _ in range(3):
            used = design[keep]
            fit = np.linalg.solve(used.T @ used + 1e-12 * np.eye(3), used.T @ d[keep])
            residual = np.abs(d - design @ fit)
            keep = residual <= 3 * median(residual) + 1e-6
        fit = fit / powers
        if np.sqrt(np.mean(residual[keep] ** 2)) < SMOOTH * side and keep.mean() > KEPT:
            end = float((points[0] - centre) @ axes[0])
            height = float(fit[0] + fit[1] * end + fit[2] * end * end)
            return centre + end * axes[0] + height * axes[1], axes[0] + (fit[1] + 2 * fit[2] * end) * axes[1]
    if len(narrow) < 4:
        return None
    piece = points[narrow]
    centre = piece.mean(axis=0)
    return centre, np.linalg.svd(piece - centre, full_matrices=False)[2][0]


def meet(a: Points, u: Points, b: Points, v: Points) -> Points | None:
    """Where the lines a + t u and b + t v cross; None when they are nearly parallel."""
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) < 0.3 * np.linalg.norm(u) * np.linalg.norm(v):
        return None
    t = ((b[0] - a[0]) * v[1] - (b[1] - a[1]) * v[0]) / cross
    return np.asarray(a + t * u)
