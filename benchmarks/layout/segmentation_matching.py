"""How found zones fit the true ones: which true zones are whole, split, merged, missed."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from services.layout.learning.label_transfer import box_areas, shared_areas
from services.layout.page import Page

Fate = Literal["whole", "merged", "split", "missed", "off"]
FATES: tuple[Fate, ...] = get_args(Fate)

WHOLE_IOU = 0.75
ALONE_IOU = 0.5
"""Where both are each other's only partner: a true line 14 px high loses 0.15 with a pixel above and below."""
HALF = 0.5
TOUCHED = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Matching:
    """Fate of every true zone, and which found zones (text and figures, in their order) are spurious."""

    fates: tuple[Fate, ...]
    spurious: NDArray[np.bool_]


def match_zones(truth: Page, found: Page) -> Matching:
    """Fates by areas of boxes; rules and noise among the found zones are left out.

    In this order, a true zone is

    - whole: one found zone has an IoU of 0.75 with it, or one of 0.5 when each holds a tenth of no other
      zone of the other side;
    - merged: a found zone covers half of it, and half of another true zone;
    - split: at least two found zones lie in it by half of their area, and together cover half of it;
    - missed: found zones cover less than half of it;
    - off: what is left, one found zone that is too large or too small.

    A found zone is spurious where true zones cover less than half of it.
    """
    zones = [zone for zone in found.zones if zone.kind in ("text", "figure")]
    if not zones or not truth.zones:
        missed_all: Fate = "missed"
        return Matching((missed_all,) * len(truth.zones), np.ones(len(zones), dtype=bool))
    shared = shared_areas(truth.zones, zones)
    true_area, found_area = box_areas(truth.zones)[:, None], box_areas(zones)[None, :]
    iou = shared / (true_area + found_area - shared)
    of_true, of_found = shared / true_area, shared / found_area
    alone = (np.sum(of_true > TOUCHED, axis=1) == 1)[:, None] & (np.sum(of_true > TOUCHED, axis=0) == 1)
    alone &= (np.sum(of_found > TOUCHED, axis=1) == 1)[:, None] & (np.sum(of_found > TOUCHED, axis=0) == 1)
    whole = np.any((iou >= WHOLE_IOU) | (alone & (iou >= ALONE_IOU)), axis=1)
    swallowed = of_true >= HALF
    merged = np.any(swallowed & (np.sum(swallowed, axis=0) > 1), axis=1)
    inside = of_found >= HALF
    covered = np.sum(np.where(inside, of_true, 0.0), axis=1)
    split = (np.sum(inside & (of_true > 0.02), axis=1) > 1) & (covered >= HALF)
    missed = np.sum(of_true, axis=1) < HALF
    chosen: NDArray[np.intp] = np.select([whole, merged, split, missed], [0, 1, 2, 3], default=4)
    spurious = np.sum(of_found, axis=0) < HALF
    fates: tuple[Fate, ...] = tuple(FATES[int(index)] for index in chosen)
    return Matching(fates, spurious)
