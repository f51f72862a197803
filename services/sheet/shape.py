"""The face of every shape of a page, and what is said where there is none."""

from dataclasses import dataclass
from typing import Literal, Protocol

from services.arrays import Floats, Points
from services.contract.rectify import Crop
from services.geometry.focal_prior import FocalLengthSource
from services.geometry.page_frame import Frame
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.geometry.sheet_aspect import SheetAspect
from services.notices import Notice
from services.sheet.surfaces import Surface

ShapeSource = Literal["text", "outline", "rules", "photo"]
"""What can show the page's shape: its text, the sheet's outline, straight print that is no text, or the photo, which is
the page."""
EXIF_CONTRADICTED = Notice(
    "exif-contradicted",
    "the page's perspective does not fit the focal length in the EXIF data (cropped or resized after it was taken?), "
    "which was left out of account.",
)


class PageShape(Protocol):
    """The shape of a page in a photo: a plane, a bent sheet or a creased one, and the evidence for it.

    All is in centred unit coordinates of the `PhotoFrame` of the evidence, and in the camera frame.
    """

    @property
    def kind(self) -> Literal["planar", "curved"]:
        """How the page is flattened."""

    @property
    def page_map(self) -> PageMap:
        """The map between the flat page and the photo."""

    @property
    def focal(self) -> float:
        """Focal length in half diagonals."""

    @property
    def focal_source(self) -> FocalLengthSource:
        """Where the focal length is from."""

    @property
    def log_focal_deviation(self) -> float:
        """Standard deviation of the focal length's logarithm as the page alone shows it; infinite if not known."""

    @property
    def line_count(self) -> int:
        """Lines of text that were traced."""

    @property
    def sources(self) -> tuple[ShapeSource, ...]:
        """What decided the shape."""

    @property
    def notices(self) -> tuple[Notice, ...]:
        """What was left out of account, and what is uncertain."""

    @property
    def sides_believed(self) -> bool:
        """Whether the sides of the sheet show this shape, with or without text."""

    @property
    def sheet_aspect(self) -> SheetAspect | None:
        """How well the sheet's aspect is known; None where that is not computed."""

    @property
    def log_aspect_deviation(self) -> float:
        """Standard deviation of the logarithm of the flat view's aspect; 0 where that is not computed."""

    @property
    def ends_at_sides(self) -> bool:
        """Whether the flat page is the whole sheet, and ends at its sides."""

    def in_space(self, centred: Points) -> Floats:
        """Points (N, 3) of the sheet that are seen at photo points (N, 2), camera frame; NaN where it ends."""

    def surface(self, view: PhotoFrame) -> Surface:
        """The surface as the answer describes it, in pixels of the photo."""

    def frame(
        self, view: PhotoFrame, points: Points, text_height_px: float, paper: Points | None, crop: Crop
    ) -> Frame:
        """View of the page: of the whole sheet, or of what is near `points` (N, 2), where its text is.

        Lengths are in pixels of the photo; `paper` (M, 2) is the outline of the sheet, if it is seen.
        """


@dataclass(frozen=True, slots=True)
class NoShape:
    """Why no shape of one kind is plausible; `reason` completes a sentence."""

    reason: str
