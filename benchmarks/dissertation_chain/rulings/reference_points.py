"""Where rulings are looked for (dissertation Appendix B), and where they may not cross."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from services.arrays import Floats, Points, Vector


def keep_dense_text(points: Points, spacing: float, least: int = 3) -> Points:
    """Points of `points` (N, 2) with at least `least` others nearer than `spacing`; all when hardly any have.

    Marks beside the page, far from all other text, would stretch the text area over the whole photo.
    """
    if len(points) <= least:
        return points
    distance, _ = cKDTree(points).query(points, k=least + 1)
    kept = points[distance[:, -1] <= spacing]
    return kept if len(kept) >= max(0.5 * len(points), least) else points


@dataclass(frozen=True, slots=True, eq=False)
class Chords:
    """The parts of lines inside a convex hull: from `low` to `high` (...) along each line, from its point.

    A line that misses the hull has the empty chord at its point, low = high = 0.
    """

    low: Floats
    high: Floats


def clip_to_hull(hull: Points, points: Points, angles: Floats) -> Chords:
    """Chords (N, J) of the lines through `points` (N, 2) at `angles` (N, J) in the convex `hull` (K, 2)."""
    edge = np.roll(hull, -1, axis=0) - hull
    outward = np.stack([edge[:, 1], -edge[:, 0]], axis=1)
    centre = hull.mean(axis=0)
    outward *= np.where(np.einsum("kx,kx->k", outward, hull - centre) < 0, -1.0, 1.0)[:, None]
    along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    rate = along @ outward.T
    gap = np.einsum("kx,nkx->nk", outward, hull - points[:, None, :])[:, None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = gap / rate
    low = np.where(rate < 0, reach, -np.inf).max(axis=-1)
    high = np.where(rate > 0, reach, np.inf).min(axis=-1)
    # Lines along an edge: outside of it they miss the hull.
    missed = (low >= high) | np.any((rate == 0) & (gap < 0), axis=-1) | ~np.isfinite(low) | ~np.isfinite(high)
    return Chords(np.where(missed, 0.0, low), np.where(missed, 0.0, high))


def choose_reference_points(hull: Points, centre: Points, angle: float, count: int) -> Points:
    """Reference points (count, 2) on the line s through `centre`, perpendicular to the ruling at `angle`.

    They have equal distances across the text, and the first and last lie just outside of it (Figure B.1). The text
    is bounded by the rulings' direction, not by s itself: a text area that leans would leave corners uncovered.
    """
    across = np.array([np.sin(angle), -np.cos(angle)])
    # s runs to the right, or upwards where the rulings lie flat: the order is the photo's, not the angle's.
    across = across if across[0] > 0 or (across[0] == 0 and across[1] > 0) else -across
    reach = (hull - centre) @ across
    step = max(float(np.ptp(reach)), 1e-6) / (count - 2)
    places = float(reach.min()) + step * (np.arange(count) - 0.5)
    return np.asarray(centre + places[:, None] * across)


def sides(points: Points, angles: Floats, others: Points) -> Floats:
    """Signed distance (N, J, M) of `others` (N, M, 2) from lines through `points` (N, 2) at `angles` (N, J)."""
    normal = np.stack([-np.sin(angles), np.cos(angles)], axis=-1)
    return np.asarray(np.einsum("njx,nmx->njm", normal, others - points[:, None, :]))


def chord_ends(points: Points, angles: Floats, chords: Chords) -> Floats:
    """Both ends (N, J, 2, 2) of the chords of lines through `points` (N, 2) at `angles` (N, J)."""
    along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    reach = np.stack([chords.low, chords.high], axis=-1)
    return np.asarray(points[:, None, None, :] + reach[..., None] * along[:, :, None, :])


def follow_in_order(hull: Points, points: Points, angles: Floats) -> NDArray[np.bool_]:
    """Which directions of neighbouring rulings go together: (N - 1, J, J) bool, [i, j, k] for i's j and i + 1's k.

    They do when each chord in the hull lies wholly on its own side of the other line: such rulings do not cross
    inside the text, and neither does any other pair of a sequence of them (each lies between its neighbours).
    """
    ends = chord_ends(points, angles, clip_to_hull(hull, points, angles))
    n, j = angles.shape
    forward = sides(points[:-1], angles[:-1], points[1:, None, :])[:, :, 0]
    backward = sides(points[1:], angles[1:], points[:-1, None, :])[:, :, 0]
    # The side of the neighbour's reference point is the neighbour's side.
    next_ends = sides(points[:-1], angles[:-1], ends[1:].reshape(n - 1, -1, 2)).reshape(n - 1, j, j, 2)
    own_ends = sides(points[1:], angles[1:], ends[:-1].reshape(n - 1, -1, 2)).reshape(n - 1, j, j, 2)
    ahead = np.all(next_ends * np.sign(forward)[:, :, None, None] > 0, axis=-1)
    behind = np.all(own_ends * np.sign(backward)[:, :, None, None] > 0, axis=-1)
    return np.asarray(ahead & behind.transpose(0, 2, 1))


def crossings_inside(hull: Points, points: Points, angles: Vector) -> int:
    """How many pairs of the rulings through `points` (N, 2) at `angles` (N,) cross inside the convex `hull`."""
    ends = chord_ends(points, angles[:, None], clip_to_hull(hull, points, angles[:, None]))[:, 0]
    everything = np.broadcast_to(ends.reshape(1, -1, 2), (len(points), 2 * len(points), 2))
    side = sides(points, angles[:, None], everything)[:, 0].reshape(len(points), -1, 2)
    split = side.min(axis=-1) * side.max(axis=-1) < -1e-18
    return int(np.triu(split & split.T, 1).sum())
