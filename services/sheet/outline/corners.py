"""Where the four sides of a closed curve meet."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector
from services.sheet.outline.edges import EdgePoints


@dataclass(frozen=True, slots=True)
class CornerParameters:
    """Lengths are shares of the curve's length unless told."""

    candidates: int = 14
    """Places that are tried as corners."""
    arm: float = 0.035
    """The turn of the curve is measured over this length to either side."""
    shortest_side: float = 0.05
    longest_side: float = 0.6
    side_samples: int = 32
    """Points of a side that its parabola is fitted to."""
    jag: float = 0.1
    """Of the mean side: what a point's distance from its side counts for at most."""
    turn_weight: float = 0.02
    """What a corner that does not turn costs, as a mean square distance from the sides over the square of the
    mean side."""
    fit_share: float = 0.2
    """Of a side, next to a corner: its curve is fitted there ..."""
    line_share: float = 0.08
    """... or, where that is not smooth, a line to this share."""
    skipped: float = 0.012
    """Of a side, next to a corner: rounded, and left out."""
    smooth: float = 0.0012
    """Of a side: residual (RMS) up to which a piece of it counts as smooth."""
    reach: float = 0.06
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


def split_sides(
    points: Points, shown: NDArray[np.bool_], parameters: CornerParameters | None = None
) -> Corners | None:
    """The four corners of a closed clockwise curve (N, 2): four smooth sides describe what is `shown` (N,) of it best.

    None when the curve does not turn in four places. Of a side that is out of the photo nothing is seen: the curve
    follows the photo's border there, and its ends, or its middle, stand for the corners.
    """
    p = parameters or CornerParameters()
    count = len(points)
    arm = max(int(p.arm * count), 2)
    turn = _turns(points, arm)
    places = _places(turn, shown, arm, p)
    if len(places) < 4:
        return None
    cost = _side_costs(points, shown, places, p)
    fours = np.array(list(itertools.combinations(range(len(places)), 4)))
    fits = sum(cost[fours[:, k], fours[:, (k + 1) % 4]] for k in range(4)) / count
    flatness = np.clip(1 - turn[places] / np.deg2rad(70.0), 0, 1.5) ** 2
    price = np.where(shown[places], flatness, 0.1)
    total = fits + p.turn_weight * price[fours].sum(axis=1)
    best = int(np.argmin(total))
    if not np.isfinite(total[best]):
        return None
    at = places[fours[best]]
    return Corners(np.asarray(at, np.intp), float(np.sqrt(fits[best])), turn[at])


def _turns(points: Points, arm: int) -> Vector:
    """(N,) signed turn of the curve at every point, over `arm` points to either side; clockwise is positive."""
    before = points - np.roll(points, arm, axis=0)
    after = np.roll(points, -arm, axis=0) - points
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(np.arctan2(cross, (before * after).sum(axis=1)))


def _places(turn: Vector, shown: NDArray[np.bool_], arm: int, p: CornerParameters) -> NDArray[np.intp]:
    """Sorted indices where corners are tried: the strongest turns, and ends and middles of what is out of view."""
    count = len(turn)
    left = turn.copy()
    chosen: list[int] = []
    while len(chosen) < p.candidates:
        k = int(np.argmax(left))
        if left[k] < np.deg2rad(15.0):
            break
        chosen.append(k)
        left[np.arange(k - arm // 2, k + arm // 2 + 1) % count] = -1
    gone = ~shown
    if gone.any() and shown.any():
        starts = np.flatnonzero(gone & ~np.roll(gone, 1))
        for start in starts:
            length = int(np.argmin(np.roll(gone, -start))) or count
            if length > 0.02 * count:
                chosen += [int(start), int((start + length - 1) % count)]
            chosen.append(int((start + length // 2) % count))
    return np.asarray(sorted(set(chosen)), np.intp)


def _side_costs(
    curve: Points, shown: NDArray[np.bool_], places: NDArray[np.intp], p: CornerParameters
) -> Floats:
    """(K, K) sum of squared distances of the shown points from place a to b from a parabola, over the squared side."""
    count = len(curve)
    unit = float(np.linalg.norm(np.ptp(curve, axis=0))) / 2
    lengths = (places[None, :] - places[:, None]) % count
    cost = np.full(lengths.shape, np.inf)
    a, b = np.nonzero((lengths >= p.shortest_side * count) & (lengths <= p.longest_side * count))
    share = np.linspace(0, 1, p.side_samples)
    index = (places[a][:, None] + np.round(share * lengths[a, b][:, None]).astype(int)) % count
    weight = shown[index].astype(np.float64)
    total = np.maximum(weight.sum(axis=1), 1.0)
    points = curve[index] / unit
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
    # A few jags of creases are no corner.
    residual = np.minimum(np.abs(d - np.einsum("sni,si->sn", design, fit)), p.jag)
    cost[a, b] = (weight * residual**2).sum(axis=1) * lengths[a, b] / p.side_samples
    return cost


def locate_corners(edge: EdgePoints, corners: Corners, parameters: CornerParameters | None = None) -> Points:
    """The corners (4, 2): where both sides' local fits meet; NaN where that is out of view or not seen."""
    p = parameters or CornerParameters()
    found = np.full((4, 2), np.nan)
    count = len(edge.points)
    for k, at in enumerate(corners.indices):
        behind = int(at - corners.indices[k - 1]) % count
        ahead = int(corners.indices[(k + 1) % 4] - at) % count
        if not edge.shown[at]:
            continue
        lines = [_end_line(edge, int(at), -1, behind, p), _end_line(edge, int(at), 1, ahead, p)]
        if lines[0] is None or lines[1] is None:
            continue
        crossing = _meet(*lines[0], *lines[1])
        length = min(behind, ahead) / count * 2 * float(np.linalg.norm(np.ptp(edge.points, axis=0))) * 1.4
        if crossing is None or np.linalg.norm(crossing - edge.points[at]) > p.reach * length:
            continue
        found[k] = crossing
    return found


def _end_line(
    edge: EdgePoints, at: int, way: int, length: int, p: CornerParameters
) -> tuple[Points, Points] | None:
    """Point and direction of a side's curve where it comes to the corner `at`; None where it is not seen there."""
    count = len(edge.points)
    skip = max(round(p.skipped * length), 2)

    def piece(share: float) -> Points:
        index = (at + way * np.arange(skip, max(round(share * length), skip + 6))) % count
        return edge.points[index[edge.seen[index]]]

    wide, narrow = piece(p.fit_share), piece(p.line_share)
    spacing = float(np.linalg.norm(edge.points[(at + way * length // 2) % count] - edge.points[at]))
    corner = edge.points[at]
    if len(wide) >= 10:
        centre = wide.mean(axis=0)
        _, _, axes = np.linalg.svd(wide - centre, full_matrices=False)
        s, d = (wide - centre) @ axes[0], (wide - centre) @ axes[1]
        fit = np.polynomial.polynomial.polyfit(s, d, 2)
        residual = d - np.polynomial.polynomial.polyval(s, fit)
        keep = np.abs(residual) <= 3 * np.median(np.abs(residual)) + 1e-9
        fit = np.polynomial.polynomial.polyfit(s[keep], d[keep], 2)
        rms = float(np.sqrt(np.mean((d - np.polynomial.polynomial.polyval(s, fit))[keep] ** 2)))
        if rms < p.smooth * 2 * spacing:
            end = float((corner - centre) @ axes[0])
            slope = fit[1] + 2 * fit[2] * end
            height = np.polynomial.polynomial.polyval(end, fit)
            return centre + end * axes[0] + height * axes[1], axes[0] + slope * axes[1]
    if len(narrow) >= 4:
        centre = np.median(narrow, axis=0)
        centre = narrow.mean(axis=0)
        _, _, axes = np.linalg.svd(narrow - centre, full_matrices=False)
        return centre, axes[0]
    return None


def _meet(a: Points, u: Points, b: Points, v: Points) -> Points | None:
    """Where the lines a + t u and b + t v cross; None when they are nearly parallel."""
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) < 0.3 * np.linalg.norm(u) * np.linalg.norm(v):
        return None
    t = ((b[0] - a[0]) * v[1] - (b[1] - a[1]) * v[0]) / cross
    return np.asarray(a + t * u)
