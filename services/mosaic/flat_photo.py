"""A photo and the flat view in which it is registered."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from services.arrays import GrayImage, Mask, Points, RgbImage, Vector
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_frame import Frame
from services.geometry.photo_frame import PhotoFrame
from services.notices import Notice
from services.sheet.evidence import PageEvidence
from services.sheet.shape import PageShape

RIM_PX = 2
"""Border of what a photo shows that is left out: its pixels mix with the outside."""
GRID = 40
"""Points across and down a photo at which it is asked what of it a view shows."""


@dataclass(frozen=True, slots=True, eq=False)
class SeenPage:
    """The shape of a page as one photo shows it, the evidence for it, and what was known of the camera beforehand."""

    shape: PageShape
    evidence: PageEvidence
    focal_prior: FocalPrior

    @property
    def view(self) -> PhotoFrame:
        """Frame of the photo, which shape and evidence are in."""
        return self.evidence.view

    @property
    def text_height_px(self) -> float:
        """Typical size of the characters in photo pixels."""
        return self.evidence.text.height_px


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
    gray : (frame.height, frame.width) view in gray, flat-fielded: bare paper is 255. Only registration asks for it; a
        view that replaces a registered one has none, (0, 0).
    shown : (frame.height, frame.width), true where the view shows the page.
    text_height_px : typical size of a character, in flat pixels.
    native_scale : flat pixels per photo pixel where the photo has most detail (below 1: the view is reduced).
    weight : confidence in its rectification relative to other photos: its number of characters.
    notices : notices about the photo for the result.
    sheet : (N, 2) photo pixels, outline of the sheet if its edge is visible against the background; else None.
    error_percent : RMS error of the view to expect, percent of its width; None where nothing shows it.
    page : the page as the photo shows it; None where the photo was taken as flat.
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
    error_percent: float | None = None
    page: SeenPage | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the view."""
        return self.frame.width, self.frame.height

    def to_photo(self, flat: Points) -> Points:
        """Photo pixels (N, 2) of flat pixels (N, 2)."""
        return self.frame.to_photo(flat)


def trust_by_error(photos: Sequence[FlatPhoto]) -> Vector:
    """Weights (n,) of views by the errors to expect of them, as of measurements: 1/error^2, 1 for the best view.

    A view that shows nothing of its error counts as the middle one of the others.
    """
    known = [photo.error_percent for photo in photos if photo.error_percent is not None]
    usual = float(np.median(known)) if known else 1.0
    errors = np.array([usual if photo.error_percent is None else photo.error_percent for photo in photos])
    return np.asarray((errors.min() / errors) ** 2)
