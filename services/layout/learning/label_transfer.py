"""Labels of zones that a person drew, for the zones that a segmenter found on the same page."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from services.layout.page import Page, Zone


def transfer_labels(truth: Page, found: Page) -> Page:
    """`found` with labels: each zone has the label of the zone in `truth` that covers most of it.

    The label is None when no true zone covers at least half of the found zone. Of two that cover it equally, the
    smaller one counts.
    """
    if not truth.zones or not found.zones:
        return replace(found, zones=tuple(replace(zone, label=None) for zone in found.zones))
    shares = shared_areas(found.zones, truth.zones) / box_areas(found.zones)[:, None]
    smaller_first = np.argsort(box_areas(truth.zones), kind="stable")
    best = smaller_first[np.argmax(np.round(shares[:, smaller_first], 3), axis=1)]
    zones = (
        replace(zone, label=truth.zones[index].label if shares[row, index] >= 0.5 else None)
        for row, (zone, index) in enumerate(zip(found.zones, best, strict=True))
    )
    return replace(found, zones=tuple(zones))


def merged_zones(truth: Page, found: Page) -> dict[int, list[int]]:
    """Places of found zones that hold several true ones of different labels, one below the other, and those of these.

    A true zone is held where half of it lies in the found one; together they are half of that.
    """
    if not truth.zones or not found.zones:
        return {}
    shared = shared_areas(found.zones, truth.zones)
    is_held = shared >= 0.5 * box_areas(truth.zones)
    covers = (shared * is_held).sum(axis=1) >= 0.5 * box_areas(found.zones)
    merged = {}
    for place in np.flatnonzero(covers & (is_held.sum(axis=1) > 1)):
        held = sorted(np.flatnonzero(is_held[place]).tolist(), key=lambda each: truth.zones[each].box[1])
        boxes = [truth.zones[each].box for each in held]
        is_stack = all((a[1] + a[3]) / 2 < b[1] and a[3] < (b[1] + b[3]) / 2 for a, b in pairwise(boxes))
        if (
            is_stack
            and found.zones[place].kind == "text"
            and len({truth.zones[each].label for each in held}) > 1
        ):
            merged[int(place)] = held
    return merged


def come_apart(truth: Page, found: Page) -> Page:
    """`found` with the true zones in place of those that hold several of them (`merged_zones`).

    So a model learns what the parts are like, and not that they are one zone with the label of the largest.
    """
    merged = merged_zones(truth, found)
    zones: list[Zone] = []
    for place, zone in enumerate(found.zones):
        parts = [truth.zones[each] for each in merged.get(place, ())]
        zones += [replace(part, id=f"{zone.id}.{n}") for n, part in enumerate(parts, 1)] or [zone]
    return replace(found, zones=tuple(zones)) if merged else found


def shared_areas(zones: Sequence[Zone], others: Sequence[Zone]) -> NDArray[np.float64]:
    """Areas that boxes of `zones` (N) and `others` (M) share, (N, M) in square pixels."""
    a = np.array([zone.box for zone in zones], dtype=np.float64).reshape(-1, 1, 4)
    b = np.array([zone.box for zone in others], dtype=np.float64).reshape(1, -1, 4)
    sides = np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2])
    return np.asarray(np.prod(np.maximum(sides, 0.0), axis=-1), dtype=np.float64)


def box_areas(zones: Sequence[Zone]) -> NDArray[np.float64]:
    """Areas of boxes (N,), at least one square pixel."""
    boxes = np.array([zone.box for zone in zones], dtype=np.float64)
    areas: NDArray[np.float64] = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
    return np.maximum(areas, 1.0)
