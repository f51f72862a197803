"""Sides of a sheet that goes on beyond the photo: two of them are followed to the photo's border, the others are out of
view.

A curve across rays closes somewhere before the border: on a line of print, or on nothing. Long sides whose edge is seen
all the way on to the border show that the sheet does not end there.
"""

from dataclasses import replace

import numpy as np

from services.arrays import Points, RgbImage
from services.sheet.outline.edges import EdgePoints, measure_sides

FOLLOWED = 0.85
"""Share of both sides on which an edge is seen before they are followed, ..."""
LOST = 0.5
"""... and below which that of a side between them is not."""
GOES_ON = 0.8
"""Least share of each side's continuation on which its edge is seen."""
END_SHARE = 0.3
"""Of a side: its end, whose direction it goes on in."""
FEWEST = 4
"""Points of a continuation that tell whether its edge is seen; a shorter one ends beside the border."""


def follow_to_border(
    photo: RgbImage, sides: list[EdgePoints], diagonal: float, window: tuple[float, float, float, float]
) -> tuple[list[EdgePoints], list[int]] | None:
    """The four measured `sides`, two opposite ones followed to the photo's border, and which others are out of view.

    None where no side is lost between two that are seen, or their edges do not go on. `diagonal` is the outline's,
    `window` the part of the photo (H, W, 3) that shows anything.
    """
    seen = [float(side.seen.mean()) for side in sides]
    for first in (0, 1):
        pair, between = (first, first + 2), (first + 1, (first + 3) % 4)
        if min(seen[k] for k in between) >= LOST or min(seen[k] for k in pair) < FOLLOWED:
            continue
        ends = {
            (k, at_end): _border_beyond(sides[k], window, at_end) for k in pair for at_end in (False, True)
        }
        tried = _follow(photo, sides, ends, diagonal, window)
        gone = [k for k in between if _goes_on(tried, sides, k)]
        if not any(seen[k] < LOST for k in gone):
            continue
        if len(gone) < 2:
            kept = {(gone[0] - 1) % 4: True, (gone[0] + 1) % 4: False}
            tried = _follow(
                photo, sides, {(k, end): ends[k, end] for k, end in kept.items()}, diagonal, window
            )
        found = [tried.get(k, side) for k, side in enumerate(sides)]
        if min(found[k].seen.mean() for k in pair) < FOLLOWED:
            continue
        for k in gone:
            start, end = ends[(k - 1) % 4, True], ends[(k + 1) % 4, False]
            found[k] = _along_border(sides[k], start, end, window)
        return found, gone
    return None


def _follow(
    photo: RgbImage,
    sides: list[EdgePoints],
    ends: dict[tuple[int, bool], Points],
    diagonal: float,
    window: tuple[float, float, float, float],
) -> dict[int, EdgePoints]:
    """Sides measured on to the `ends` on the border, of numbers of sides and whether it is the last end."""
    guides = {k: sides[k].points[sides[k].seen] for k, _ in ends}
    for (k, at_end), end in ends.items():
        guides[k] = np.concatenate([guides[k], end[None]] if at_end else [end[None], guides[k]])
    measured = measure_sides(photo, list(guides.values()), diagonal, window)
    return dict(zip(guides, measured, strict=True))


def _goes_on(followed: dict[int, EdgePoints], sides: list[EdgePoints], between: int) -> bool:
    """Whether both neighbours of a side go on beyond it; so they do where it is beside the border and not clear."""
    for k, at_end in (((between - 1) % 4, True), ((between + 1) % 4, False)):
        old = sides[k].points[sides[k].seen]
        way = old[-1] - old[0]
        along = (followed[k].points - old[0]) @ way / (way @ way)
        seen = followed[k].seen[along > 1 if at_end else along < 0]
        if len(seen) < FEWEST:
            if sides[between].seen.mean() >= FOLLOWED:
                return False
        elif seen.mean() < GOES_ON:
            return False
    return True


def _border_beyond(side: EdgePoints, window: tuple[float, float, float, float], at_end: bool) -> Points:
    """Where a side that goes straight on, `at_end` or before its start, meets the border of `window`."""
    middle, way = end_direction(side.points[side.seen] if at_end else side.points[side.seen][::-1])
    return np.asarray(middle + room_to_border(middle, way, window) * way)


def end_direction(points: Points) -> tuple[Points, Points]:
    """Middle (2,) of the last part of a side's `points` (N, 2), and the direction (2,) in which the side goes on."""
    last = points[-max(round(END_SHARE * len(points)), 2) :]
    middle = last.mean(axis=0)
    way = np.linalg.svd(last - middle, full_matrices=False)[2][0]
    return middle, way if (last[-1] - last[0]) @ way > 0 else -way


def room_to_border(start: Points, way: Points, window: tuple[float, float, float, float]) -> float:
    """Steps `way` (2,) from `start` (2,) to the border of `window`."""
    low, high = np.array(window[:2]), np.array(window[2:])
    with np.errstate(divide="ignore"):
        steps = np.where(way > 0, (high - start) / way, (low - start) / way)
    return float(steps[np.abs(way) > 1e-9].min())


def _along_border(
    side: EdgePoints, start: Points, end: Points, window: tuple[float, float, float, float]
) -> EdgePoints:
    """`side` out of view, along the border from `start` to `end`, by a corner of the photo where they are apart."""
    low, high = np.array(window[:2]), np.array(window[2:])
    corners = [np.array([start[0], end[1]]), np.array([end[0], start[1]])]
    on_border = [c for c in corners if np.isclose(c, low).any() and np.isclose(c, high).any()]
    on_border += [c for c in corners if np.isclose(c, low).all() or np.isclose(c, high).all()]
    shared = np.isclose(start, end) & (np.isclose(start, low) | np.isclose(start, high))
    path = np.array([start, end] if shared.any() or not on_border else [start, on_border[0], end])
    at = np.linspace(0, len(path) - 1, len(side.points))
    points = np.column_stack([np.interp(at, np.arange(len(path)), path[:, k]) for k in range(2)])
    nothing = np.zeros(len(points), bool)
    return replace(side, points=points, seen=nothing, shown=nothing, strength=np.zeros(len(points)))
