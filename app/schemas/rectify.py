"""The form of POST /rectify."""

import re
from typing import Annotated

from fastapi import UploadFile
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from app.schemas.options import (
    TURNS_PATTERN,
    Absent,
    AskedArchive,
    AskedPagesFormat,
    AskedPdfVersion,
    CallbackUrl,
    CameraName,
    Embed,
    EmbedFormat,
    Illumination,
    Language,
    MaxPixels,
    Quality,
    ReadText,
    Switch,
    Title,
    Uploads,
    Upright,
    checked_turns,
    files_may_be_uploads,
    turn_of,
)
from app.schemas.photo_points import (
    CORNERS_PATTERN,
    REGION_PATTERN,
    checked_corners,
    checked_region,
    parse_corners,
    parse_region,
)
from services.contract.rectify import (
    MOST_MARGIN,
    Crop,
    OnNoText,
    PageKind,
    Pages,
    RectifyParameters,
    Rotation,
)
from services.errors import InvalidOption


def _parse_turns(text: str) -> tuple[Rotation | None, ...]:
    return tuple(turn_of(entry) for entry in text.split(","))


PAPER_PATTERN = "^(auto|none|a3|a4|a5|letter|legal|[1-9][0-9]{1,2}x[1-9][0-9]{1,2}(mm)?)$"
"""Pattern of `paper` in the OpenAPI document. The parser also accepts tenths of a millimetre, and sizes to 5000."""
_PAPER = re.compile(r"auto|none|a3|a4|a5|letter|legal|(\d{2,4}(?:\.\d)?)x(\d{2,4}(?:\.\d)?)(mm)?")


def _checked_paper(text: str) -> str:
    paper = text.strip().lower() or "auto"
    found = _PAPER.fullmatch(paper)
    if found is None or not all(10 <= float(side) <= 5000 for side in found.groups()[:2] if side):
        raise ValueError(
            "expected auto, none, a3, a4, a5, letter, legal, or width x height in millimetres as 210x297 (10 to 5000)"
        )
    return paper


class RectifyForm(BaseModel):
    """The multipart form of POST /rectify."""

    model_config = ConfigDict(extra="forbid", json_schema_extra=files_may_be_uploads)

    image: Annotated[list[UploadFile], Field(min_length=1)] = Field(
        description="The photo: JPEG, PNG, WebP, TIFF or HEIC/HEIF. Several pages: several parts of this name in their "
        "order, or a TIFF file or PDF."
    )
    kind: PageKind = Field(default="auto", description="planar or curved: skip the decision between both.")
    upright: Upright = True
    focal_length_px: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)] | Absent = Field(
        default=None, description="Known focal length; default: from EXIF if present, else estimated."
    )
    region: Annotated[str, AfterValidator(checked_region)] | Absent = Field(
        default=None,
        description="JSON [[x, y], ...] of 3 to 200 points, pixels of the photo after its EXIF rotation: polygon "
        "around the page's text, to guide text identification. For one photo only.",
        json_schema_extra={"contentMediaType": "application/json", "pattern": REGION_PATTERN},
    )
    corners: Annotated[str, AfterValidator(checked_corners)] | Absent = Field(
        default=None,
        description="JSON [[x, y], [x, y], [x, y], [x, y]]: the sheet's corners in the photo, pixels after its EXIF "
        "rotation, clockwise from the page's top left. They are exact and not moved; the sides between them are "
        "sought. Several pages: a list with an entry for each, null where they are to be found.",
        json_schema_extra={"contentMediaType": "application/json", "pattern": CORNERS_PATTERN},
    )
    rotate: Annotated[str, BeforeValidator(checked_turns)] = Field(
        default="auto",
        description="Clockwise turn of the flat page in degrees, in place of the one that `upright` finds (which "
        "`orientation.rotation_deg` says), or with `corners` of the page that begins at the first of them: auto, 0, "
        "90, 180 or 270. Several pages: an entry for each, as auto,90,auto, or one for all.",
        json_schema_extra={"pattern": TURNS_PATTERN},
    )
    margin: Annotated[float, Field(ge=0, le=MOST_MARGIN, allow_inf_nan=False)] = Field(
        default=0.0, description="What is shown around the cut, percent of the page's width."
    )
    illumination: Illumination = "keep"
    crop: Crop = Field(
        default="sheet",
        description="Content of the view: the sheet cut at its edges, the text with margins, or all of the photo "
        "near the text.",
    )
    pages: Pages = Field(
        default="main",
        description="For an open book: the main page of the photo, or both pages, left before right. With `both` the "
        "response is a list of pages, even for one page.",
    )
    paper: Annotated[str, AfterValidator(_checked_paper)] = Field(
        default="auto",
        description="True size of the sheet: auto (a format where the sheet's corners are seen and only one has its "
        "proportions), none, a3, a4, a5, letter, legal, or width x height in millimetres (210x297).",
        json_schema_extra={"pattern": PAPER_PATTERN},
    )
    on_no_text: OnNoText | Absent = Field(
        default=None,
        description="keep: pass a photo through as it is when neither text nor an outline shows its page's shape; "
        "refuse: answer `no-text`. Default: refuse for one page, keep for several.",
    )
    preview: Switch = Field(
        default=False,
        description="With format=json, for live use: mesh, outline, quality and advice from a reduced photo. Nothing "
        "is drawn, read or turned upright.",
    )
    keep_photo: Switch | Absent = Field(
        default=None,
        description="Keep the photo with what later answers need: the response has `page_id` (header "
        "`Document-Page-Id`), see /pages. Default: the setting KEEP_PHOTOS (false, unless the operator has changed "
        "it).",
    )
    camera: CameraName = None
    text: ReadText = False
    language: Language = None
    format: AskedPagesFormat = None
    quality: Quality = None
    embed: Embed = False
    embed_format: EmbedFormat = None
    max_width: MaxPixels = None
    max_height: MaxPixels = None
    pdf_version: AskedPdfVersion = "1.7"
    title: Title = None
    archive: AskedArchive = "images"
    callback_url: CallbackUrl = None
    upload: Uploads = []

    def parameters(self) -> RectifyParameters:
        """The options of the rectification, without those of the response format.

        Raises
        ------
        InvalidOption
            When `corners` come with an option that does not go with them.
        """
        for name, asked in (("region", self.region is not None), ("pages", self.pages == "both")):
            if self.corners and asked:
                raise InvalidOption(
                    f"corners: they are those of one sheet; send the request without {name}, or without corners.",
                    "corners",
                )
        return RectifyParameters(
            kind=self.kind,
            upright=self.upright and not self.preview,
            focal_length_px=self.focal_length_px,
            region=None if self.region is None else parse_region(self.region),
            illumination=self.illumination,
            crop=self.crop,
            pages=self.pages,
            paper=self.paper,
            on_no_text=self.on_no_text,
            text=self.text,
            language=self.language or None,
            preview=self.preview,
            camera=self.camera or None,
            corners=parse_corners(self.corners) if self.corners else (),
            rotate=_parse_turns(self.rotate),
            margin=self.margin,
        )
