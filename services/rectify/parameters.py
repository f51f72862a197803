"""What a caller may ask of `rectify`."""

from dataclasses import dataclass
from typing import Literal

PageKind = Literal["auto", "planar", "curved"]
Illumination = Literal["keep", "normalize"]


@dataclass(frozen=True, slots=True)
class RectifyParameters:
    """Options of one rectification; the HTTP contract's fields of the same names.

    `region` is a polygon ((x, y), ...) in pixels of the EXIF-upright photo, round the page text.
    """

    kind: PageKind = "auto"
    upright: bool = True
    focal_length_px: float | None = None
    region: tuple[tuple[float, float], ...] | None = None
    illumination: Illumination = "keep"
