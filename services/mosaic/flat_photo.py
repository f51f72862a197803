"""A photo and the flat view in which it is registered."""

from dataclasses import dataclass

from services.arrays import GrayImage, Mask, Points, RgbImage
from services.geometry.page_frame import Frame
from services.notices import Notice


@dataclass(frozen=True, slots=True, eq=False)
class FlatPhoto:
    """A photo and its flat view.

    *Flat pixels* are pixels of this view, `frame.width` x `frame.height`, a few megapixels at most. Registration uses
    them throughout. Apart from errors of rectification, views of one page differ by a shift, a scale and quarter turns.

    Attributes
    ----------
    index : index in the upload.
    photo : (H, W, 3).
    frame : flat pixels -> photo pixels.
    gray : (frame.height, frame.width) view in gray, flat-fielded: bare paper is 255.
    shown : (frame.height, frame.width), true where the view shows the page.
    text_height_px : typical size of a character, in flat pixels.
    native_scale : flat pixels per photo pixel where the photo has most detail (below 1: the view is reduced).
    weight : confidence in its rectification relative to other photos: its number of characters.
    notices : notices about the photo for the result.
    sheet : (N, 2) photo pixels, outline of the sheet if its edge is visible against the background; else None.
    """

    index: int
    photo: RgbImage
    frame: Frame
    gray: GrayImage
    shown: Mask
    text_height_px: float
    native_scale: float
    weight: float
    notices: tuple[Notice, ...] = ()
    sheet: Points | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the view."""
        return self.frame.width, self.frame.height

    def to_photo(self, flat: Points) -> Points:
        """Photo pixels (N, 2) of flat pixels (N, 2)."""
        return self.frame.to_photo(flat)
