"""Positions of label chips on a picture of the page: close to their zones, without overlap of chips and print."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Rect = tuple[int, int, int, int]
"""(x0, y0, x1, y1) in whole pixels, x1 and y1 excluded."""

_ON_CHIP = 50.0
"""Weight of an area of another label that is covered, against that of a zone's area."""
_ON_OWN_ZONE = 0.95
"""Weight of the own zone's area. It is lower than that of other zones, where a label would be misunderstood."""
_LESS_LIKED = 0.06
"""Cost, in areas of the label, of each place further down the list."""
_STEPS = 12
"""Number of labels up and down in which a free place is searched if all near the zone are taken."""


def place_chips(
    sizes: Sequence[tuple[int, int]], zones: Sequence[Rect], bounds: Rect
) -> list[tuple[int, int]]:
    """Top left corners for labels of `sizes` (width, height), one for each of `zones`, in the order of importance.

    Every label lies within `bounds` (one that is larger starts at their corner). Each takes the best place about
    its zone: off the labels before it, then off the zones, then as it is usual (on the top edge, at the left).
    """
    boxes = np.array(zones, np.float64).reshape(-1, 4)
    taken = np.zeros((0, 4))
    found = []
    for at, (width, height) in enumerate(sizes):
        corners = _candidates(boxes[at], width, height)
        low, high = np.array(bounds[:2]), np.maximum(np.array(bounds[2:]) - (width, height), bounds[:2])
        corners = np.clip(corners, low, high)
        places = np.hstack([corners, np.add(corners, (width, height))])
        weights = np.ones(len(boxes))
        weights[at] = _ON_OWN_ZONE
        cost = (
            _shared_areas(places, taken).sum(axis=1) * _ON_CHIP
            + _shared_areas(places, boxes) @ weights
            + _LESS_LIKED * width * height * np.arange(len(places))
        )
        best = places[int(np.argmin(cost))]
        taken = np.vstack([taken, best])
        found.append((int(best[0]), int(best[1])))
    return found


def _candidates(zone: NDArray[np.float64], width: int, height: int) -> NDArray[np.float64]:
    """Top left corners about a zone, (N, 2), the most liked first."""
    x0, y0, x1, y1 = zone
    around = [
        (x0, y0 - height),
        (x0 - width, y0),
        (x1, y0),
        (x1 - width, y0 - height),
        (x0, y1),
        (x1 - width, y1),
        (x1 - width, y0),
        (x0, y0),
        (x1 - width, y1 - height),
    ]
    steps = [step * sign for step in range(1, _STEPS + 1) for sign in (1, -1)]
    away = [(x, y0 + step * height) for step in steps for x in (x0 - width, x1, x0)]
    return np.array(around + away, np.float64).round()


def _shared_areas(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Areas that rectangles (N, 4) and (M, 4) share, (N, M)."""
    across = np.minimum(a[:, None, 2], b[None, :, 2]) - np.maximum(a[:, None, 0], b[None, :, 0])
    down = np.minimum(a[:, None, 3], b[None, :, 3]) - np.maximum(a[:, None, 1], b[None, :, 1])
    shared: NDArray[np.float64] = np.maximum(across, 0.0) * np.maximum(down, 0.0)
    return shared
