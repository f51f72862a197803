"""Options of /rectify."""

from dataclasses import dataclass
from typing import Literal

from services.contract.cameras import CameraMemory

PageKind = Literal["auto", "planar", "curved"]
Illumination = Literal["keep", "normalize"]
Crop = Literal["sheet", "text", "photo"]
Pages = Literal["main", "both"]
OnNoText = Literal["refuse", "keep"]


@dataclass(frozen=True, slots=True)
class RectifyParameters:
    """Options of one rectification. The fields have the names of the HTTP contract.

    `region` is a polygon ((x, y), ...) around the text of the page, in pixels of the EXIF-upright photo. `crop` selects
    the visible area: the sheet cut at its edges, the text with margins, or the photo around the page. `pages` "both"
    selects both pages of an open book. `paper` is `auto`, `none`, a paper format, or `210x297` in millimetres. `text`
    reads the page in `language` (`eng+fra`; None: the default). `on_no_text` "keep" passes a photo through as it is
    when nothing shows the shape of its page. `preview` describes the page from a reduced photo and draws nothing.
    `camera` names the camera, None: as EXIF names it; `cameras` are those that are remembered.
    """

    kind: PageKind = "auto"
    upright: bool = True
    focal_length_px: float | None = None
    region: tuple[tuple[float, float], ...] | None = None
    illumination: Illumination = "keep"
    crop: Crop = "sheet"
    pages: Pages = "main"
    paper: str = "auto"
    on_no_text: OnNoText = "refuse"
    text: bool = False
    language: str | None = None
    preview: bool = False
    camera: str | None = None
    cameras: tuple[CameraMemory, ...] = ()
