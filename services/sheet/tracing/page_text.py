"""The text of a page as its photo shows it."""

from dataclasses import dataclass

from services.arrays import Floats, GrayImage, Mask, Points
from services.geometry.homographies import resizing
from services.geometry.photo_frame import PhotoFrame


@dataclass(frozen=True, slots=True, eq=False)
class PageText:
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

    def H_reduced_centred(self, view: PhotoFrame) -> Floats:
        """From the centred unit coordinates of `view` to pixels of `gray`."""
        return resizing(self.factor) @ view.H_photo_centred
