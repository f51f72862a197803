"""First step of segmentation and measuring: the components of a page, classified and levelled."""

from dataclasses import dataclass, replace

import numpy as np

from services.arrays import GrayImage
from services.layout.segmentation.components import Boxes, Kinds, classify_components
from services.layout.segmentation.ink import (
    LARGEST_SKEW_DEG,
    InkComponents,
    estimate_skew,
    find_components,
    find_ink,
    glyph_height,
)


@dataclass(frozen=True, slots=True)
class LevelledFrame:
    """From pixels of the page to the levelled working copy: divided by `scale`, turned by -atan(slope).

    `size` is the width and height of the working copy.
    """

    scale: tuple[float, float]
    slope: float
    size: tuple[int, int]

    @property
    def mean_scale(self) -> float:
        """Pixels of the page per pixel of the working copy."""
        return float(np.sqrt(self.scale[0] * self.scale[1]))

    def level(self, boxes: Boxes) -> Boxes:
        """Boxes (N, 4) of the working copy after their centres are turned about its origin; their sides stay."""
        if self.slope == 0.0 or len(boxes) == 0:
            return boxes
        cos = 1.0 / np.hypot(1.0, self.slope)
        sin = self.slope * cos
        half = (boxes[:, 2:] - boxes[:, :2]) / 2
        x, y = ((boxes[:, :2] + boxes[:, 2:]) / 2).T
        centre = np.column_stack([cos * x + sin * y, cos * y - sin * x])
        return np.concatenate([centre - half, centre + half], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class PrintedPage:
    """Components of a page on its working copy, as they lie and levelled, their kinds, and the glyph height, px."""

    components: InkComponents
    levelled: InkComponents
    kinds: Kinds
    unit: float
    frame: LevelledFrame


def analyse_print(gray: GrayImage) -> PrintedPage | None:
    """Components of a page (H, W) uint8; None when it has no ink that may be print."""
    if gray.size == 0:
        return None
    ink = find_ink(gray)
    components = find_components(ink)
    unit = glyph_height(components, max(ink.mask.shape)) if len(components) else 0.0
    if unit == 0.0:
        return None
    steepest = float(np.tan(np.radians(LARGEST_SKEW_DEG)))
    kinds = classify_components(components, unit, steepest)
    height, width = ink.mask.shape
    frame = LevelledFrame(ink.scale, estimate_skew(components.boxes[kinds.glyphs]), (width, height))
    levelled = replace(components, boxes=frame.level(components.boxes))
    return PrintedPage(components, levelled, kinds, unit, frame)
