"""What a caller may ask of /rectify."""

from dataclasses import dataclass
from typing import Literal

PageKind = Literal["auto", "planar", "curved"]
Illumination = Literal["keep", "normalize"]
Crop = Literal["sheet", "text", "photo"]
Pages = Literal["main", "both"]


@dataclass(frozen=True, slots=True)
class RectifyParameters:
    """Options of one rectification; the HTTP contract's fields of the same names.

    `region` is a polygon ((x, y), ...) in pixels of the EXIF-upright photo, round the page text. `crop` says what the
    view shows: the sheet cut at its edges, the text with margins, or all of the photo near it. `pages` "both" asks for
    both pages of an opened book.
    """

    kind: PageKind = "auto"
    upright: bool = True
    focal_length_px: float | None = None
    region: tuple[tuple[float, float], ...] | None = None
    illumination: Illumination = "keep"
    crop: Crop = "sheet"
    pages: Pages = "main"
