"""Requests about kept photos: what a person says of a page, and which pages form a file."""

from typing import Annotated, Literal, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from app.schemas.options import FORMAT, NUMBER, EmbedFormat, Language, MaxPixels, Quality, ReadText, Switch
from services.contract.answers.page import Point
from services.contract.images import PdfVersion
from services.contract.kept_pages import MOST_BOUND_PAGES, PageWish
from services.contract.rectify import MOST_MARGIN, Corners, Crop, Illumination, Rotation

PictureFormat = Literal["jpeg", "png", "webp", "tiff", "pdf", "json"]
PICTURE_FORMATS: tuple[PictureFormat, ...] = get_args(PictureFormat)
FileFormat = Literal["pdf", "tiff", "zip", "txt", "hocr", "alto", "markdown"]
FILE_FORMATS: tuple[FileFormat, ...] = get_args(FileFormat)


def _turn(value: object) -> object:
    """`auto` or degrees; as a form sends them, too."""
    entry = str(value).strip().lower()
    if value is None or entry == "auto":
        return None if value is None else entry
    if isinstance(value, bool) or entry not in ("0", "90", "180", "270"):
        raise ValueError("expected auto, 0, 90, 180 or 270")
    return int(entry)


def _corners(value: object) -> object:
    """`auto`, or four points."""
    if isinstance(value, str):
        if value.strip().lower() != "auto":
            raise ValueError("expected [[x, y], ...] of the four corners, or auto")
        return "auto"
    return value


class Picture(BaseModel):
    """How a picture is sent."""

    model_config = ConfigDict(extra="forbid")

    quality: Quality = None
    max_width: MaxPixels = None
    max_height: MaxPixels = None
    pdf_version: PdfVersion = Field(default="1.7", description="Version of a PDF: 1.7, or a-2b for archives.")
    title: str = Field(default="", max_length=300, description="Title of a PDF; default: name of the photo.")
    text: ReadText = False
    language: Language = None


class RenderRequest(Picture):
    """What a person says about a kept page; what is absent stays as it is."""

    corners: (
        Annotated[
            Annotated[list[Point], Field(min_length=4, max_length=4)] | Literal["auto"],
            BeforeValidator(_corners),
        ]
        | None
    ) = Field(
        default=None,
        description="The sheet's corners in the photo, clockwise from the page's top left; auto: find "
        "them again. The page is analysed again.",
    )
    rotate: Annotated[Literal["auto"] | Rotation, BeforeValidator(_turn)] | None = Field(
        default=None, description="Clockwise turn as of /rectify; auto: the one that was found."
    )
    margin: Annotated[float, Field(ge=0, le=MOST_MARGIN, allow_inf_nan=False), NUMBER] | None = Field(
        default=None, description="What is shown around the cut, percent of the page's width."
    )
    illumination: Illumination | None = Field(default=None, description="As of /rectify.")
    crop: Crop | None = Field(default=None, description="As of /rectify.")
    format: Annotated[PictureFormat | None, FORMAT] = Field(
        default=None, description="Format of the response; overrides `Accept`. Default: that of the photo."
    )
    embed: Switch = Field(default=False, description="With JSON: include the image as base64 in `image`.")
    embed_format: EmbedFormat = None

    @property
    def wish(self) -> PageWish:
        """What is wished of the page, without the response format."""
        corners: Corners | Literal["auto"] | None = None
        if self.corners == "auto":
            corners = "auto"
        elif self.corners is not None:
            a, b, c, d = self.corners
            corners = (a, b, c, d)
        return PageWish(corners, self.rotate, self.margin, self.illumination, self.crop)


class BindRequest(Picture):
    """Kept pages of one file, in this order; each as it was last answered."""

    pages: Annotated[list[str], Field(min_length=1, max_length=MOST_BOUND_PAGES)] = Field(
        description="Ids of kept pages; one may be there several times."
    )
    format: Annotated[FileFormat, FORMAT] = Field(default="pdf", description="Format of the file.")
