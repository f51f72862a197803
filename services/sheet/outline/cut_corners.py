"""Corners that are folded in or torn off: sides end where their straight parts end, corners are where these meet.

An outline that is followed from corner to corner takes the edge of a fold for a part of a side. A side that is straight
but for a piece at its end, which leaves it in a kink, is that straight part alone. Bent sides have no kink.
"""

from dataclasses import replace

import numpy as np

from services.arrays import Floats, Mask, Points
from services.sheet.outline.corners import meet
from services.sheet.outline.results import CORNER_BEYOND, SheetOutline, SheetSide

# Lengths are shares of the side's length.
MIN_POINTS = 20
STRAIGHT = 0.002
"""Points of the straight part lie within this: edges of flat sheets leave 0.0003."""
FAR = 0.01
"""The piece that is cut off leaves the line by more."""
LEAST_SHARE = 0.6
"""Of the straight part."""
KINK_RAD = float(np.deg2rad(15.0))
"""A fold turns the edge by 45 degrees, a bent sheet by less than this from one point to the fifth."""
KINK_POINTS = 5


def end_before_cut_corners(outline: SheetOutline) -> SheetOutline:
    """The outline with sides that end where their straight parts end, and corners where these sides meet.

    A corner whose sides do not meet near the sheet is NaN. The polygon stays what is seen of the sheet.
    """
    sides, corners = list(outline.sides), outline.corners.copy()
    cut: set[int] = set()
    for k, side in enumerate(outline.sides):
        straight = _straight_part(side.points)
        if straight is None or straight.all():
            continue
        sides[k] = _part_of(side, straight)
        cut |= {(k + end) % 4 for end, kept in ((0, straight[0]), (1, straight[-1])) if not kept}
    if not cut:
        return outline
    for k in cut:
        corners[k] = _corner(sides[k - 1], sides[k], outline.polygon)
    return replace(outline, sides=(sides[0], sides[1], sides[2], sides[3]), corners=corners)


def _straight_part(points: Points) -> Mask | None:
    """Which points (N,) lie on the straight part of a side, if it has one that ends in kinks; all if nothing is cut."""
    count = len(points)
    if count < MIN_POINTS:
        return None
    length = float(np.linalg.norm(points[-1] - points[0]))
    whole = _distances(points, points[:1], points[-1:] - points[:1])
    if (whole < STRAIGHT * length).all():
        return np.ones(count, bool)
    first, last = np.triu_indices(count, k=count // 3)
    along = points[last] - points[first]
    off = _distances(points, points[first], along)
    near = off < STRAIGHT * length
    best = int(np.argmax(near.sum(axis=1)))
    on = np.flatnonzero(near[best])
    begin, end = int(on[0]), int(on[-1]) + 1
    straight = np.zeros(count, bool)
    straight[begin:end] = True
    if near[best, begin:end].mean() < 0.9 or end - begin < LEAST_SHARE * count:
        return None
    for piece in (np.arange(begin - 1, -1, -1), np.arange(end, count)):
        if not len(piece):
            continue
        leaves = off[best, piece].max() > FAR * length and _turn(points, piece, along[best]) > KINK_RAD
        if not leaves:
            return None
    return straight


def _distances(points: Points, at: Points, along: Points) -> Floats:
    """Distances (K, N) of `points` (N, 2) from lines through places (K, 2), `along` (K, 2)."""
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    # Of places near the first point, so that no large numbers are subtracted.
    origin = points[0]
    return np.asarray(np.abs(across @ (points - origin).T - (across * (at - origin)).sum(axis=1)[:, None]))


def _turn(points: Points, piece: np.ndarray, along: Points) -> float:
    """Angle (rad) between the direction `along` (2,) and the beginning of a `piece` of points."""
    # From the last straight point on, so that a step aside is a turn too.
    inner = piece[0] - 1 if len(piece) < 2 or piece[1] > piece[0] else piece[0] + 1
    outer = piece[min(KINK_POINTS, len(piece)) - 1]
    way = points[outer] - points[inner]
    sine = abs(float(along[0] * way[1] - along[1] * way[0]))
    return float(np.arctan2(sine, abs(float(along @ way))))


def _part_of(side: SheetSide, kept: Mask) -> SheetSide:
    points = side.points[kept]
    off = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(points))
    return SheetSide(points, side.deviations[kept], side.seen * float(kept.mean()), float(off))


def _corner(before: SheetSide, after: SheetSide, polygon: Points) -> Floats:
    """Where the lines of two sides (2,) meet; NaN where they do not near the sheet."""
    nowhere = np.full(2, np.nan)
    if min(len(before.points), len(after.points)) < MIN_POINTS // 2:
        return nowhere
    lines = []
    for points in (before.points[-(len(before.points) // 2) :], after.points[: len(after.points) // 2]):
        middle = points.mean(axis=0)
        lines += [middle, np.linalg.svd(points - middle)[2][0]]
    place = meet(lines[0], lines[1], lines[2], lines[3])
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    reach = CORNER_BEYOND * float((high - low).max())
    if place is None or (place < low - reach).any() or (place > high + reach).any():
        return nowhere
    return np.asarray(place)
