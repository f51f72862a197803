"""Request and response of POST /rectify."""

import re
from typing import Annotated, Literal

from fastapi import UploadFile
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from app.schemas.capture import Quality as PhotoQuality
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
    Upright,
    checked_turns,
    turn_of,
)
from app.schemas.page import Answer, Embedded, EmbeddedMediaType, FlatPage, Point, Warning
from app.schemas.page_text import ReadText as PageText
from app.schemas.photo_points import (
    CORNERS_PATTERN,
    REGION_PATTERN,
    checked_corners,
    checked_region,
    parse_corners,
    parse_region,
)
from app.schemas.problem import Problem
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

    model_config = ConfigDict(extra="forbid")

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


Direction = tuple[float, float, float]


class Evidence(Answer):
    """Evidence for the decision between planar and curved, and for the shape."""

    major_convergence: float | None = Field(
        description="S3/S1 of the text lines' flow; null: too few samples."
    )
    minor_convergence: float | None = Field(description="S3/S1 of the strokes' flow; null: too few samples.")
    text_area_fraction: float = Field(ge=0, le=1, description="Share of the photo that is text.")
    source: list[Literal["text", "outline", "rules", "photo"]] = Field(
        description="Sources of the shape: text, the sheet's edges, straight lines of print other than text; "
        "`photo`: the photo is the flat page already (a scan, a page of a PDF, a page that an app has cropped)."
    )
    outline_confidence: float | None = Field(
        ge=0, le=1, description="Confidence of the sheet's edges; null: none were found."
    )
    sides_seen: int = Field(ge=0, le=4, description="Number of sides of the sheet with a visible edge.")
    print_kept: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="Share of the characters on the sheet that the view shows with their whole box; null: no text.",
    )
    flatness_error_percent: float | None = Field(
        default=None,
        ge=0,
        description="Error of the mesh to expect (RMS after the best similarity, percent of the page's width), by what "
        "the view shows of itself; null where it shows nothing, and in previews.",
    )


class Camera(Answer):
    """The camera, known or estimated."""

    focal_length_px: float | None
    field_of_view_deg: float | None = Field(description="Along the diagonal.")
    source: Literal["estimated", "exif", "given", "assumed", "remembered"] = Field(
        description="Seen in this page, from EXIF, from the request, of a typical camera, or as earlier photos of this "
        "camera showed it."
    )
    name: str | None = Field(
        default=None,
        description="Name of the camera by the request or by EXIF; its focal length is remembered.",
    )
    page_focal_length_px: float | None = Field(
        default=None,
        description="Focal length that this page alone shows; null: it does not show it clearly.",
    )
    page_focal_deviation: float | None = Field(
        default=None, ge=0, description="Standard deviation of the logarithm of `page_focal_length_px`."
    )
    principal_point: Point | None = Field(description="Photo pixels.")
    principal_point_source: Literal["centre", "estimated"] = Field(
        description="The photo's centre, or, for a cropped photo, estimated from the page."
    )


class Plane(Answer):
    """A flat page."""

    type: Literal["plane"] = "plane"
    normal: Direction | None = Field(description="Unit, camera frame: x right, y down, z forward.")


class Ruling(Answer):
    """Straight line on a curved page."""

    point: Point
    angle_deg: float
    vanishing_point: Point | None


class Strips(Answer):
    """A curved page as planar strips between rulings."""

    type: Literal["strips"] = "strips"
    normals: list[Direction]
    rulings: list[Ruling]


class CreasedSheet(Answer):
    """A creased page as a mesh with a regular grid of nodes on the flat sheet."""

    type: Literal["mesh"] = "mesh"
    rows: int = Field(ge=2, description="Rows of nodes.")
    columns: int = Field(ge=2)
    points: list[list[Point]] = Field(description="Photo point of every node.")
    normals: list[list[Direction]] = Field(description="Unit normal of every cell, camera frame.")


class PageSize(Answer):
    """Size of the sheet in millimetres; null for what is not known, and `reason` says why."""

    width_mm: float | None
    height_mm: float | None
    dpi: float | None = Field(description="Pixels of the flat view per inch of the sheet.")
    paper: str | None = Field(description="Name of the format, or the size as it was sent.")
    source: Literal["outline", "given", "file"] | None = Field(
        description="The sheet's proportions, the request, or the resolution of a file that is the page itself; null: "
        "the size is not known."
    )
    reason: str
    aspect: float | None = Field(description="Width over height of the sheet, if its four corners are seen.")
    aspect_deviation: float | None = Field(description="Standard deviation of the aspect's logarithm.")
    stretch: float | None = Field(
        description="Factor by which the view's width over its height was changed to have the proportions of the size "
        "that the request names; null: it was not fitted."
    )


class RectifyResult(FlatPage):
    """The frontal flat view of one photo, and the evidence for it."""

    kind: Literal["planar", "curved"]
    evidence: Evidence
    camera: Camera
    surface: Annotated[Plane | Strips | CreasedSheet, Field(discriminator="type")]
    page: PageSize | None = Field(default=None, description="True size of the sheet.")
    quality: PhotoQuality | None = Field(
        default=None, description="How well the photo can be read; null for a page without text."
    )
    text: PageText | None = Field(default=None, description="The text, if it was asked for.")
    warnings: list[Warning]
    timings_ms: dict[str, float]
    image: Embedded = None
    image_media_type: EmbeddedMediaType = None
    page_id: str | None = Field(
        default=None, description="Id of the kept page, as in /pages/{id}; null: its photo was not kept."
    )


class FailedPage(Answer):
    """A page that could not be flattened; the others are not lost."""

    problem: Problem


class PagesResult(Answer):
    """The flat views of all pages: in the order of the upload, and of one photo left before right."""

    pages: list[RectifyResult | FailedPage] = Field(min_length=1)
    warnings: list[Warning] = Field(description="About all pages together; each page also has its own.")
    timings_ms: dict[str, float] = Field(description="Stages of the whole work; each page also has its own.")
