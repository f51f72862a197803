"""Attributes of edges (5.3): the relative position of two zones of a page, as qualitative descriptors.

Of a pair the zone that starts higher is the *upper* one. Relations say where the *lower* zone is. A new relation is
an entry of `RELATIONS`; matching and learning need not know of it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.node_attributes import ZoneMeasures, order_from_top

Descriptors = NDArray[np.intp]

ALIGNED_X, ALIGNED_Y = 0.01, 0.008
"""Boundaries nearer than this share of the page's width or height are aligned: half an em of ordinary print."""


@dataclass(frozen=True, slots=True)
class PairMeasures:
    """Measurements of E pairs of zones, from which relations are computed.

    `upper` and `lower` (E, 4) are boxes as shares of the page, `font_steps` log2 of the lower's font size over
    the upper's, NaN where unknown; `next_below` says that no zone lies between them in the upper's own column,
    `next_above` in the lower's; `places_apart` is their distance when zones are counted from the top.
    """

    upper: NDArray[np.float64]
    lower: NDArray[np.float64]
    font_steps: NDArray[np.float64]
    next_below: NDArray[np.bool_]
    next_above: NDArray[np.bool_]
    places_apart: NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Relation:
    """One qualitative attribute: `measure` gives the index of a descriptor for every pair (E,)."""

    name: str
    descriptors: tuple[str, ...]
    measure: Callable[[PairMeasures], Descriptors]
    scale: float


def pair_zones(measures: ZoneMeasures, most_neighbours: int) -> NDArray[np.intp]:
    """Pairs (E, 2) of (upper, lower) zones: all of them, on crowded pages only the nearest of every zone.

    A page is crowded when it has more than twice `most_neighbours` zones; distances are between boxes.
    """
    zones = len(measures.boxes)
    place = order_from_top(measures.boxes)
    first, second = np.triu_indices(zones, 1)
    if zones > 2 * most_neighbours:
        x0, y0, x1, y1 = measures.boxes.T
        gap_x = np.maximum(np.maximum(x0[:, None] - x1, x0 - x1[:, None]), 0.0)
        gap_y = np.maximum(np.maximum(y0[:, None] - y1, y0 - y1[:, None]), 0.0)
        distance = gap_x**2 + gap_y**2
        np.fill_diagonal(distance, np.inf)
        near = np.zeros((zones, zones), dtype=bool)
        # Of zones that are equally near the upper ones are nearest, in any order of the zones.
        from_top = np.argsort(place)
        nearest = from_top[np.argsort(distance[:, from_top], axis=1, kind="stable")[:, :most_neighbours]]
        np.put_along_axis(near, nearest, True, axis=1)
        keep = (near | near.T)[first, second]
        first, second = first[keep], second[keep]
    swap = place[first] > place[second]
    return np.stack([np.where(swap, second, first), np.where(swap, first, second)], axis=1)


def measure_pairs(measures: ZoneMeasures, pairs: NDArray[np.intp]) -> PairMeasures:
    """Measures of `pairs` (E, 2) of (upper, lower) zones."""
    boxes = measures.boxes
    upper, lower = pairs.T
    place = order_from_top(boxes)
    below, above = _neighbours(boxes, place)
    with np.errstate(all="ignore"):
        font_steps = np.log2(measures.font_ratios[lower] / measures.font_ratios[upper])
    return PairMeasures(
        upper=boxes[upper],
        lower=boxes[lower],
        font_steps=font_steps,
        next_below=below[upper] == lower,
        next_above=above[lower] == upper,
        places_apart=place[lower] - place[upper],
    )


def _neighbours(
    boxes: NDArray[np.float64], place: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """For each zone the next one below it that shares a column of pixels, and the next above; -1 where none does.

    Of several at one height it is the first from the top, by `place` (N,).
    """
    if not len(boxes):
        return np.empty(0, np.intp), np.empty(0, np.intp)
    from_top = np.argsort(place)
    x0, y0, x1, y1 = boxes[from_top].T
    over = np.minimum(x1[:, None], x1) - np.maximum(x0[:, None], x0) > 0
    down = np.where(over & (y0 > y0[:, None]), y0 - y0[:, None], np.inf)
    up = np.where(over & (y1 < y1[:, None]), y1[:, None] - y1, np.inf)
    below = np.where(np.isfinite(down.min(axis=1)), down.argmin(axis=1), -1)
    above = np.where(np.isfinite(up.min(axis=1)), up.argmin(axis=1), -1)
    none_last = np.append(from_top, -1)
    return none_last[below[place]], none_last[above[place]]


def _boundaries(of_upper: int, of_lower: int, tolerance: float) -> Callable[[PairMeasures], Descriptors]:
    """Before, aligned or after: where a boundary of the lower zone is, seen from a boundary of the upper one."""

    def compare(pairs: PairMeasures) -> Descriptors:
        difference = pairs.lower[:, of_lower] - pairs.upper[:, of_upper]
        return (difference > tolerance).astype(np.intp) - (difference < -tolerance) + 1

    return compare


def _centres(pairs: PairMeasures) -> Descriptors:
    difference = (pairs.lower[:, 0] + pairs.lower[:, 2] - pairs.upper[:, 0] - pairs.upper[:, 2]) / 2
    return (difference > ALIGNED_X).astype(np.intp) - (difference < -ALIGNED_X) + 1


def _gap(axis: int, bounds: tuple[float, ...]) -> Callable[[PairMeasures], Descriptors]:
    """Class of the distance between the boxes along one axis."""

    def classify(pairs: PairMeasures) -> Descriptors:
        gap = np.maximum(
            pairs.lower[:, axis] - pairs.upper[:, axis + 2], pairs.upper[:, axis] - pairs.lower[:, axis + 2]
        )
        return np.digitize(np.maximum(gap, 0.0), bounds)

    return classify


def _font_step(pairs: PairMeasures) -> Descriptors:
    """Two classes smaller, alike, two classes larger; an unknown step counts as alike."""
    return np.digitize(np.nan_to_num(pairs.font_steps), (-0.35, -0.12, 0.12, 0.35))


def _neighbourhood(pairs: PairMeasures) -> Descriptors:
    return pairs.next_below + 2 * pairs.next_above.astype(np.intp)


def _same_row(pairs: PairMeasures) -> Descriptors:
    upper, lower = pairs.upper, pairs.lower
    shared = np.minimum(upper[:, 3], lower[:, 3]) - np.maximum(upper[:, 1], lower[:, 1])
    least = np.minimum(upper[:, 3] - upper[:, 1], lower[:, 3] - lower[:, 1])
    return (shared > 0.5 * least).astype(np.intp)


_ACROSS = ("to-the-left", "aligned", "to-the-right")
_ALONG = ("above", "aligned", "below")

RELATIONS: tuple[Relation, ...] = (
    Relation("top-top", _ALONG, _boundaries(1, 1, ALIGNED_Y), 0.15),
    Relation("top-bottom", _ALONG, _boundaries(1, 3, ALIGNED_Y), 0.15),
    Relation("bottom-top", _ALONG, _boundaries(3, 1, ALIGNED_Y), 0.15),
    Relation("bottom-bottom", _ALONG, _boundaries(3, 3, ALIGNED_Y), 0.15),
    Relation("left-left", _ACROSS, _boundaries(0, 0, ALIGNED_X), 0.15),
    Relation("left-right", _ACROSS, _boundaries(0, 2, ALIGNED_X), 0.15),
    Relation("right-left", _ACROSS, _boundaries(2, 0, ALIGNED_X), 0.15),
    Relation("right-right", _ACROSS, _boundaries(2, 2, ALIGNED_X), 0.15),
    Relation("centre-centre", _ACROSS, _centres, 0.15),
    Relation(
        "gap-along",
        ("touching", "line", "wide-line", "lines", "block", "far", "page"),
        _gap(1, (0.004, 0.01, 0.02, 0.04, 0.1, 0.3)),
        0.18,
    ),
    Relation("gap-across", ("none", "narrow", "wide", "page"), _gap(0, (0.002, 0.05, 0.3)), 0.18),
    Relation("font-step", ("much-smaller", "smaller", "alike", "larger", "much-larger"), _font_step, 0.15),
    Relation("neighbours", ("apart", "next-below", "next-above", "next"), _neighbourhood, 0.25),
    Relation(
        "places-apart",
        ("one", "two", "three", "more"),
        lambda pairs: np.minimum(pairs.places_apart, 4) - 1,
        0.22,
    ),
    Relation("same-row", ("apart", "same"), _same_row, 0.15),
)
"""The nine relations of boundaries and central lines (5.6.1), distances, the ratio of font sizes, and neighbourhood."""
