"""A coloured band along a side of the sheet: its border is as good an edge as the sheet's own, with page beyond it.

What tells it from the sheet's end is a second outline that shares three sides with the first and goes round a strip
beside the fourth, as wide as the sheet: the sides next to it do not end there.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from services.arrays import Points, RgbImage, Vector
from services.geometry.polygons import distances_within
from services.order_statistics import median, quantile
from services.sheet.outline.beyond_photo import end_direction, room_to_border
from services.sheet.outline.edges import EdgePoints, measure_sides
from services.sheet.outline.results import BELIEVED_CONFIDENCE, WHOLE_SIDE, SheetOutline

NARROWEST = 0.01
"""Of the diagonal: a band is wider, and nine tenths of a side that both outlines have lie nearer to the other one."""
FARTHEST = 0.3
"""Of a side's length, by which it may go on."""
GAP = 3
"""Points of a continuation, of 120, that are not seen one after the other: there it ends."""


def is_seen_whole(outline: SheetOutline) -> bool:
    """Whether an outline is believed, and all of its four sides are seen."""
    return (
        outline.confidence >= BELIEVED_CONFIDENCE and min(side.seen for side in outline.sides) >= WHOLE_SIDE
    )


def band_side(outer: Points, sides: Sequence[Points]) -> int | None:
    """Which of the four `sides`, each (N, 2), has a band beside it that a curve (M, 2) goes round; None if none has.

    The curve runs along the other three.
    """
    diagonal = float(np.linalg.norm(np.ptp(np.concatenate(sides), axis=0)))
    found: int | None = None
    depths: Vector = np.zeros(0)
    for k, side in enumerate(sides):
        within = distances_within(side, outer) / diagonal
        if quantile(np.abs(within), 0.9) < NARROWEST:
            continue
        if found is not None:
            return None
        found, depths = k, within
    if found is None:
        return None
    return found if all(median(part) > NARROWEST for part in np.array_split(depths, 3)) else None


def round_bands(
    photo: RgbImage, sides: Sequence[EdgePoints], window: tuple[float, float, float, float]
) -> Iterator[Points]:
    """Closed clockwise curves (N, 2) round what may lie beyond one of the four `sides`, clockwise and all seen.

    `window` is the part of the photo (H, W, 3) that shows anything.
    """
    seen = [side.points[side.seen] for side in sides]
    diagonal = float(np.linalg.norm(np.ptp(np.concatenate(seen), axis=0)))

    def ends_of(numbers: Sequence[int], *, at_end: bool) -> dict[int, Points]:
        """Where the sides of these numbers end that go on by more than the narrowest band."""
        guides = {k: _way_on(seen[k] if at_end else seen[k][::-1], window) for k in numbers}
        long = {k: guide for k, guide in guides.items() if _length(guide) > NARROWEST * diagonal}
        measured = measure_sides(photo, list(long.values()), diagonal, window) if long else []
        ends = {k: _last_seen(side) for k, side in zip(long, measured, strict=True)}
        return {k: end for k, end in ends.items() if _length([long[k][0], end]) > NARROWEST * diagonal}

    # Mostly no side goes on: the other neighbour of a band is followed only where the first one does.
    before = ends_of(range(4), at_end=True)
    after = ends_of([(k + 2) % 4 for k in before], at_end=False)
    for k in range(4):
        first, last = (k - 1) % 4, (k + 1) % 4
        if first in before and last in after:
            others = [seen[(k + n) % 4] for n in (1, 2, 3)]
            yield np.concatenate([*others, np.linspace(before[first], after[last], len(seen[k]))])


def _length(ends: Sequence[Points] | Points) -> float:
    return float(np.linalg.norm(ends[1] - ends[0]))


def _way_on(points: Points, window: tuple[float, float, float, float]) -> Points:
    """Both ends (2, 2) of the line on which a side that is seen at `points` (N, 2) goes on within the `window`."""
    middle, way = end_direction(points)
    start = middle + ((points[-1] - middle) @ way) * way
    room = max(room_to_border(start, way, window), 1.0)
    return np.stack(
        [start, start + min(FARTHEST * float(np.linalg.norm(points[-1] - points[0])), room) * way]
    )


def _last_seen(side: EdgePoints) -> Points:
    """Point (2,) of a measured continuation before the first gap in its edge."""
    gone = np.convolve(~side.seen, np.ones(GAP), "valid") == GAP
    count = int(np.argmax(gone)) if gone.any() else len(side.seen)
    return np.asarray(side.points[max(count - 1, 0)])
