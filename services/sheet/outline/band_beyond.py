"""A coloured band along a side of the sheet: its border is as good an edge as the sheet's own, with page beyond it.

What tells it from the sheet's end is a second outline that shares three sides with the first and goes round a strip
beside the fourth, as wide as the sheet: the sides next to it do not end there.
"""

from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from services.arrays import Points, RgbImage
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
    curve = outer.astype(np.float32)
    within = [
        np.array([cv2.pointPolygonTest(curve, (float(x), float(y)), True) for x, y in side]) / diagonal
        for side in sides
    ]
    shared = [bool(np.quantile(np.abs(depths), 0.9) < NARROWEST) for depths in within]
    if sum(shared) != 3:
        return None
    found = shared.index(False)
    parts = np.array_split(within[found], 3)
    return found if all(float(np.median(part)) > NARROWEST for part in parts) else None


def round_bands(
    photo: RgbImage, sides: Sequence[EdgePoints], window: tuple[float, float, float, float]
) -> Iterator[Points]:
    """Closed clockwise curves (N, 2) round what may lie beyond one of the four `sides`, clockwise and all seen.

    `window` is the part of the photo (H, W, 3) that shows anything.
    """
    seen = [side.points[side.seen] for side in sides]
    diagonal = float(np.linalg.norm(np.ptp(np.concatenate(seen), axis=0)))
    guides = [guide for points in seen for guide in (_way_on(points, window), _way_on(points[::-1], window))]
    ends = [_last_seen(side) for side in measure_sides(photo, guides, diagonal, window)]
    far = [
        np.linalg.norm(end - guide[0]) > NARROWEST * diagonal for end, guide in zip(ends, guides, strict=True)
    ]
    for k in range(4):
        before, after = 2 * ((k - 1) % 4), 2 * ((k + 1) % 4) + 1
        if far[before] and far[after]:
            others = [seen[(k + n) % 4] for n in (1, 2, 3)]
            yield np.concatenate([*others, np.linspace(ends[before], ends[after], len(seen[k]))])


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
