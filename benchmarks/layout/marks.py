"""Words and ink of a labelled page: which part of them gets its right label."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage
from services.layout.learning.label_transfer import box_areas, shared_areas
from services.layout.page import Page, Zone
from services.layout.segmentation.ink import find_ink
from services.ocr.engine import Word

MOST_INK_POINTS = 20_000
"""Points of ink that stand for all ink of a page; the share of 20 000 points is exact to 0.4 %."""
SAME_ZONE = 0.6
"""IoU from which a found zone is the true one."""


@dataclass(frozen=True, slots=True, eq=False)
class Marks:
    """Points (P, 2) of a page, in its pixels, and the right `labels` (P,) of them: only points within true zones."""

    points: NDArray[np.float64]
    labels: tuple[str | None, ...]


def word_marks(words: Sequence[Word], truth: Page) -> Marks:
    """The centres of the words with letters or figures that were read within true zones."""
    read = [word.box for word in words if any(map(str.isalnum, word.text))]
    boxes = np.array(read, dtype=np.float64).reshape(-1, 4)
    return _marks((boxes[:, :2] + boxes[:, 2:]) / 2, truth)


def ink_marks(gray: GrayImage, truth: Page) -> Marks:
    """Points of ink within true zones, evenly chosen from all ink of the page."""
    ink = find_ink(gray)
    y, x = np.nonzero(ink.mask)
    step = max(1, len(x) // MOST_INK_POINTS)
    points = (np.column_stack([x, y])[::step] + 0.5) * ink.scale - 0.5
    return _marks(points, truth)


def _marks(points: NDArray[np.float64], truth: Page) -> Marks:
    zone = zone_of_points(points, truth.zones)
    kept = zone >= 0
    return Marks(points[kept], tuple(truth.zones[index].label for index in zone[kept]))


def zone_of_points(points: NDArray[np.float64], zones: Sequence[Zone]) -> NDArray[np.intp]:
    """Index (P,) of the smallest zone that holds each point, -1 where none does."""
    owner = np.full(len(points), -1, dtype=np.intp)
    if not zones:
        return owner
    x, y = points.T
    for index in np.argsort(-box_areas(zones), kind="stable"):
        x0, y0, x1, y1 = zones[index].box
        owner[(x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)] = index
    return owner


def count_right(marks: Marks, found: Page) -> tuple[int, int]:
    """Points that lie in a found zone of their right label, and all points."""
    zone = zone_of_points(marks.points, found.zones)
    given = [found.zones[index].label if index >= 0 else None for index in zone]
    return sum(a == b for a, b in zip(marks.labels, given, strict=True)), len(marks.labels)


def count_zones_right(truth: Page, found: Page) -> tuple[int, int]:
    """True zones that a found zone of the same label fits by an IoU of `SAME_ZONE`, and all true zones."""
    if not truth.zones or not found.zones:
        return 0, len(truth.zones)
    shared = shared_areas(truth.zones, found.zones)
    union = box_areas(truth.zones)[:, None] + box_areas(found.zones) - shared
    same = np.array([[a.label == b.label for b in found.zones] for a in truth.zones])
    return int(np.any((shared / union >= SAME_ZONE) & same, axis=1).sum()), len(truth.zones)
