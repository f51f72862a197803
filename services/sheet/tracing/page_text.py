"""The text of a page as its photo shows it."""

from dataclasses import dataclass
from functools import cached_property

from services.arrays import Floats, GrayImage, Mask, Points
from services.geometry.homographies import resizing
from services.geometry.photo_frame import PhotoFrame
from services.imaging.binary_masks import close_mask, spread_mask

MOST_PIXELS = 8e6
"""Bound of a flat view in which lines are sought, for every shape."""
CLOSING = 8.0
"""Gaps in the text's area that are filled, in text heights: words whose characters were not recognized as such."""


@dataclass(frozen=True, eq=False)
class TracedText:
    """Text found in the reduced photo.

    `gray` (H, W) is the flat-fielded photo resized by `factor`, `ink` (H, W) the strokes of the text and `area` (H, W)
    where there is text in it. `characters` (N, 2) are the centres of the characters and `height_px` is their typical
    size, both in photo pixels. Where the text was found in the photo's negative, `positive` is as `gray` of the photo
    itself.
    """

    gray: GrayImage
    ink: Mask
    area: Mask
    factor: float
    characters: Points
    height_px: float
    positive: GrayImage | None = None

    @cached_property
    def filled_area(self) -> Mask:
        """`area` with the words that were not found as text: these lie between others that were."""
        side = max(round(CLOSING * self.height_px * self.factor), 1) | 1
        return spread_mask(close_mask(self.area, side), side // 4 | 1)

    def H_reduced_centred(self, view: PhotoFrame) -> Floats:
        """From the centred unit coordinates of `view` to pixels of `gray`."""
        return resizing(self.factor) @ view.H_photo_centred
