"""Answers of POST /rectify."""

from typing import Annotated, Literal

from pydantic import Field

from services.contract.answers.capture import Quality as PhotoQuality
from services.contract.answers.page import Answer, Embedded, EmbeddedMediaType, FlatPage, Point, Warning
from services.contract.answers.page_text import ReadText as PageText
from services.contract.answers.problem import Problem

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
