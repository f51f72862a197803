"""Labels of zones that a person drew, for the zones that a segmenter found on the same page."""

from collections.abc import Sequence
from dataclasses import replace

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
