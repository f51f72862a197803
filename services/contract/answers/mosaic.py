"""The answer of POST /mosaic."""

from typing import Literal

from pydantic import Field

from services.contract.answers.page import Answer, Embedded, EmbeddedMediaType, Orientation, Point, Warning
from services.contract.answers.page_text import ReadText as PageText


class PatchMesh(Answer):
    """`target[r][c]` is the mosaic's point of photo pixel (c (width-1)/(columns-1), r (height-1)/(rows-1)).

    Photo pixels outside the page get the point of the nearest node on the page.
    """

    rows: int = Field(ge=2)
    columns: int = Field(ge=2)
    target: list[list[Point]]


Space = tuple[float, float, float]


class SheetCamera(Answer):
    """The camera of a photo of one bent sheet. Lengths in space are in widths of the sheet.

    A point X of the sheet is at (x, y, z) = `rotation` X + `translation` in the camera's frame (x right, y down, z
    forward), and seen at `principal_point` + `focal_length_px` (x / z, y / z).
    """

    focal_length_px: float = Field(gt=0)
    principal_point: Point = Field(description="Photo pixels.")
    rotation: tuple[Space, Space, Space] = Field(description="Rows of the rotation matrix.")
    translation: Space


class SheetSurface(Answer):
    """The bent sheet that all photos of the page show, as a mesh with a regular grid of nodes on the flat sheet."""

    kind: Literal["smooth", "creased"]
    reference: int = Field(ge=0, description="Index of the photo in whose camera frame the nodes are.")
    fitted: bool = Field(
        description="true: the sheet was fitted to all photos; false: it is that of the reference photo alone, which "
        "the others confirm."
    )
    residual_text_heights: float = Field(
        ge=0,
        description="Median distance between where the photo that fits worst shows points of the sheet, and where its "
        "camera should see them.",
    )
    rows: int = Field(ge=2)
    columns: int = Field(ge=2)
    nodes: list[list[Space]] = Field(description="Rows of nodes in space, in widths of the sheet.")


class Patch(Answer):
    """Contribution of one photo to the page."""

    placed: bool
    mesh: PatchMesh | None = Field(
        description="null: the photo is not placed; then all further fields are null too."
    )
    scale: float | None = Field(description="Pixels of the mosaic per pixel of the photo, at its centre.")
    sharpness: float | None = Field(
        ge=0, le=1, description="Sharpness of its text relative to the sharpest photo."
    )
    covered_fraction: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="Share of its part of the page that glare, a shadow or a finger hides, and that other photos show.",
    )
    camera: SheetCamera | None = Field(default=None, description="Its camera, if the page has a `surface`.")


class Pair(Answer):
    """Two overlapping photos, `a` < `b`, and the evidence for their overlap (4.3)."""

    a: int = Field(ge=0)
    b: int = Field(ge=0)
    matches: int = Field(ge=0, description="Candidate matches of features.")
    votes: int = Field(ge=0, description="Matches in the largest group of one scale and displacement.")
    runner_up_votes: int = Field(ge=0, description="Matches in the second largest group.")
    overlap_fraction: float = Field(description="Share of the smaller photo's view.")
    residual_px: float = Field(ge=0, description="RMS distance of block matches, pixels of the mosaic.")


class MosaicResult(Answer):
    """The whole page, and the evidence for its composition."""

    width: int = Field(ge=1)
    height: int = Field(ge=1)
    base: int = Field(ge=0, description="Index of the photo where the composition started.")
    orientation: Orientation
    patches: list[Patch] = Field(description="One for each photo, in the order of the upload.")
    pairs: list[Pair]
    surface: SheetSurface | None = Field(
        default=None,
        description="The bent sheet that all photos of the page show; null: it is flat, or each photo was flattened by "
        "itself.",
    )
    unplaced: list[int] = Field(description="Photos that could not be placed; `warnings` say why.")
    text: PageText | None = Field(
        default=None, description="The text, if it was asked for; its words have no places in the photos."
    )
    warnings: list[Warning]
    timings_ms: dict[str, float]
    image: Embedded = None
    image_media_type: EmbeddedMediaType = None
    page_id: str | None = Field(
        default=None, description="Id of the kept page, as in /pages/{id}; null: the page was not kept."
    )
