"""A page whose shape is known, before it is drawn."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from services.arrays import Mask, Points
from services.contract.rectify import Crop, Rotation
from services.geometry.page_frame import Frame
from services.geometry.photo_frame import PhotoFrame
from services.geometry.vanishing_points import FlowVanishingPoints
from services.imaging.ground import Ground
from services.notices import Notice
from services.rectify.analysis.found_text import FoundText
from services.rectify.analysis.page_analysis import PageAnalysis
from services.sheet.outline.results import SheetOutline
from services.sheet.shape import PageShape


@dataclass(frozen=True, slots=True, eq=False)
class ShapedPage:
    """The shape of a page, relative to the principal point of `view`, and the evidence for it.

    `analysis` and `vanishing_points` are None where text does not show the shape; `outline` is the sheet's, where it
    was found.
    """

    view: PhotoFrame
    shape: PageShape
    notices: tuple[Notice, ...]
    outline: SheetOutline | None = None
    analysis: PageAnalysis | None = None
    vanishing_points: FlowVanishingPoints | None = None
    straight_print: Points | None = None
    """Ends (M, 2) of straight lines, photo pixels, where these alone show the shape."""
    ground: Ground | None = None
    """The paper, where it is of one kind up to the photo's frame."""
    corners: Points | None = None
    """Corners (4, 2) of the sheet in photo pixels that a person gave, clockwise from the page's top left; exact."""
    text: FoundText | None = None
    """What was found of its text, where its directions were not needed."""
    departure: float | None = None
    """Of a photo that is the page itself: see `sure_departure`; None where its view must show how flat it is."""
    turn: Rotation | None = None
    """Of a printed page: the clockwise turn after which it is upright."""
    others: Iterator["ShapedPage"] = field(default_factory=lambda: iter(()))
    """The same page by other shapes, the likeliest one first; each is fitted when it is asked for."""

    @property
    def on_page(self) -> Mask:
        """Which characters (M,) are the page's: those outside of a sheet found without text are texture of the desk."""
        found = np.zeros((0, 2)) if self.analysis is None else self.analysis.characters
        if self.outline is None or self.shape.sources != ("outline",) or self.shape.ends_at_sides:
            return np.ones(len(found), bool)
        return self.outline.holds(found)

    @property
    def characters(self) -> Points:
        """Centres of the page's characters (N, 2) in photo pixels; none where text does not show the shape."""
        return np.zeros((0, 2)) if self.analysis is None else self.analysis.characters[self.on_page]

    @property
    def text_height_px(self) -> float:
        """Typical size of the characters in photo pixels; 0 where text does not show the shape."""
        return 0.0 if self.analysis is None else self.analysis.text_height_px

    @property
    def extent(self) -> Points:
        """Photo points (M, 2) that the view must show: the characters, else the outline, else the straight print."""
        characters = self.characters
        if len(characters) > 0 or self.shape.ends_at_sides:
            return characters
        if self.outline is not None:
            return self.outline.polygon
        return np.zeros((0, 2)) if self.straight_print is None else self.straight_print

    def frame(self, paper: Points | None, crop: Crop) -> Frame:
        """The part of the flat page that is shown; `paper` (M, 2) is the sheet's end in the photo, where it is seen.

        Without text the sheet is all that there is to show.
        """
        crop = "sheet" if self.analysis is None else crop
        return self.shape.frame(self.view, self.extent, self.text_height_px, paper, crop)
