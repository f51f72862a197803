"""Labels of zones that a person drew, for the zones that a segmenter found on the same page."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from services.layout.grouping.line_cuts import places_of_cuts
from services.layout.page import Page, Zone, ZoneWord

WITHIN = 0.8
"""Least share of a part that lies in the zone it is a part of."""
LINE_OF_DRAWN = 0.5
"""Least height of a line in a drawn box of one line: print has three quarters of it, a box of two lines more room."""
MOST_OF_ZONE = 0.75
"""Share of a zone from which on a part of it is the zone."""


def transfer_labels(truth: Page, found: Page) -> Page:
    """`found` with labels: each zone has that of the smallest zone in `truth` that covers half of it.

    So a zone within another one, as print within a dark border, has its own label. It is None where no true zone covers
    half of the found one.
    """
    if not truth.zones or not found.zones:
        return replace(found, zones=tuple(replace(zone, label=None) for zone in found.zones))
    shares = shared_areas(found.zones, truth.zones) / box_areas(found.zones)[:, None]
    areas = np.where(shares >= 0.5, box_areas(truth.zones), np.inf)
    zones = (
        replace(zone, label=truth.zones[int(np.argmin(own))].label if np.isfinite(own).any() else None)
        for zone, own in zip(found.zones, areas, strict=True)
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
    """`found` with the true zones in place of those that hold several of them (`merged_zones`), or one as a part.

    So a model learns what the parts are like, and not that they are one zone with the label of the largest.
    """
    merged, within = merged_zones(truth, found), zones_within(truth, found)
    zones: list[Zone] = []
    for place, zone in enumerate(found.zones):
        parts = [truth.zones[each] for each in merged.get(place, within.get(place, ()))]
        if not parts:
            zones.append(zone)
            continue
        left = [] if place in merged else _what_is_left(zone, parts)
        zones += [replace(part, id=f"{zone.id}.{n}") for n, part in enumerate([*parts, *left], 1)]
    return replace(found, zones=tuple(zones)) if merged or within else found


def zones_within(truth: Page, found: Page) -> dict[int, list[int]]:
    """Places of found zones that hold zones of `truth` with a label as parts of themselves, and those of these.

    A part lies in the found zone for the most part, and is not most of it; no other zone with a label is. What a zone
    holds is known by its words.
    """
    if not truth.zones or not found.zones:
        return {}
    shared = shared_areas(found.zones, truth.zones)
    inside = shared >= WITHIN * _areas_in_rows(truth.zones, found.zones)
    is_part = inside & (shared < MOST_OF_ZONE * box_areas(found.zones)[:, None])
    is_labelled = np.array([zone.label is not None for zone in truth.zones])
    is_whole = (shared >= MOST_OF_ZONE * box_areas(found.zones)[:, None]) & is_labelled
    is_part &= is_labelled & ~is_whole.any(axis=1)[:, None] & ~is_whole.any(axis=0)
    is_part &= np.array([zone.kind == "text" for zone in truth.zones])  # a picture is no part of a line
    is_part &= np.array([zone.kind == "text" and bool(zone.words) for zone in found.zones])[:, None]
    return {
        int(place): np.flatnonzero(is_part[place]).tolist() for place in np.flatnonzero(is_part.any(axis=1))
    }


def _areas_in_rows(drawn: Sequence[Zone], zones: Sequence[Zone]) -> NDArray[np.float64]:
    """Areas (N, M) of the boxes `drawn` (M), those of one line no higher than each of `zones` (N).

    People draw round a value with room above and below it.
    """
    boxes = np.array([zone.box for zone in drawn], dtype=np.float64)
    width, height = boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1]
    own = np.array([zone.box[3] - zone.box[1] for zone in zones])[:, None]
    return np.asarray(width * np.where(own >= LINE_OF_DRAWN * height, np.minimum(height, own), height))


def _what_is_left(zone: Zone, parts: Sequence[Zone]) -> list[Zone]:
    """The zone without its parts: parts of its lines, as recognition cuts them; none has a label."""

    def is_inside(word: ZoneWord) -> bool:
        x, y = (word.box[0] + word.box[2]) / 2, (word.box[1] + word.box[3]) / 2
        return any(p.box[0] <= x <= p.box[2] and p.box[1] <= y <= p.box[3] for p in parts)

    left = []
    for row in dict.fromkeys(word.line for word in zone.words):
        own = [word for word in zone.words if word.line == row]
        em = zone.font_size or max(word.box[3] - word.box[1] for word in own)
        cuts = [0, *places_of_cuts(own, em), len(own)]
        for begin, end in pairwise(cuts):
            words = [word for word in own[begin:end] if not is_inside(word)]
            if words:
                left.append(_part_of(zone, words))
    return left


def _part_of(zone: Zone, words: Sequence[ZoneWord]) -> Zone:
    boxes = np.array([word.box for word in words])
    (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    return replace(
        zone,
        box=(float(x0), float(y0), float(x1), float(y1)),
        lines=1,
        text=" ".join(word.text for word in words),
        words=tuple(replace(word, line=0) for word in words),
        content={},
        label=None,
    )


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
