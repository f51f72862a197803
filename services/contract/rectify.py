"""Options of /rectify."""

from dataclasses import dataclass
from typing import Literal

from services.contract.cameras import CameraMemory

PageKind = Literal["auto", "planar", "curved"]
Illumination = Literal["keep", "normalize", "gray", "bw"]
"""`gray` and `bw` (black and white) are looks of a scanner; the light is evened out before."""
Crop = Literal["sheet", "text", "photo"]
Pages = Literal["main", "both"]
OnNoText = Literal["refuse", "keep"]
Rotation = Literal[0, 90, 180, 270]
"""A clockwise turn in degrees."""
Corners = tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]
"""Four points of the photo, clockwise from the page's top left."""
MOST_MARGIN = 20.0
"""Percent of the page's width."""


@dataclass(frozen=True, slots=True)
class PrintedWord:
    """A word that a page of a PDF prints, as its file says.

    `box` (x0, y0, x1, y1) is in fractions of the width and height of the page's picture. `line` numbers its lines.
    """

    text: str
    box: tuple[float, float, float, float]
    line: int


@dataclass(frozen=True, slots=True)
class TypesetPage:
    """A page of a PDF that is set in type, not an image of a page: it is flat, and upright after a clockwise `turn`.

    `words` are those that it prints; without any they are not known, and the page is read as others are.
    `has_pictures`: it may show print that is not among them.
    """

    turn: Rotation
    words: tuple[PrintedWord, ...] = ()
    has_pictures: bool = True


Origin = Literal["photo", "page"] | TypesetPage
"""Where a picture is from: a camera, a scanner or an unknown program, or a page of a PDF."""


@dataclass(frozen=True, slots=True)
class PageParameters:
    """Options of a page, whether it is in one photo or in several. All fields have the names of the HTTP contract.

    `text` reads the page in `language` (`eng+fra`; None: the default). `camera` names the camera of all photos, None:
    as EXIF names it; `cameras` are those that are remembered. `keep_photo`: the reply has what later answers need
    (`services.contract.kept_pages`).
    """

    upright: bool = True
    text: bool = False
    language: str | None = None
    camera: str | None = None
    cameras: tuple[CameraMemory, ...] = ()
    keep_photo: bool = False


@dataclass(frozen=True, slots=True)
class RectifyParameters(PageParameters):
    """Options of one rectification.

    `region` is a polygon ((x, y), ...) around the text of the page, in pixels of the EXIF-upright photo. `crop` selects
    the visible area: the sheet cut at its edges, the text with margins, or the photo around the page. `pages` "both"
    selects both pages of an open book. `paper` is `auto`, `none`, a paper format, or `210x297` in millimetres.
    `on_no_text` "keep" passes a photo through as it is when nothing shows the shape of its page; None: where there are
    several pages. `preview` describes the page from a reduced photo and draws nothing.

    `corners` are those of the sheet in each page's photo, pixels of the EXIF-upright photo; none, or one entry for each
    page, None where they are sought. `rotate` is the turn of each page's view in place of the one that is found, None
    where it is sought; a single entry is that of all pages. `margin` is what is shown around the cut, percent of the
    page's width.
    """

    kind: PageKind = "auto"
    focal_length_px: float | None = None
    region: tuple[tuple[float, float], ...] | None = None
    illumination: Illumination = "keep"
    crop: Crop = "sheet"
    pages: Pages = "main"
    paper: str = "auto"
    on_no_text: OnNoText | None = None
    preview: bool = False
    corners: tuple[Corners | None, ...] = ()
    rotate: tuple[Rotation | None, ...] = (None,)
    margin: float = 0.0

    @property
    def page_corners(self) -> Corners | None:
        """The corners of the only page, if they are given."""
        return self.corners[0] if self.corners else None

    @property
    def page_turn(self) -> Rotation | None:
        """The turn of the only page, if it is given."""
        return self.rotate[0]
