"""Parts of responses that describe a page."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Point = tuple[float, float]


class Answer(BaseModel):
    """Part of a response. It allows documented fields only, and no infinite numbers or NaN."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Orientation(Answer):
    """Rotation and mirroring that turned the flat view upright."""

    rotation_deg: Literal[0, 90, 180, 270] = Field(
        description="Clockwise turn, after the mirroring if any, of the page whose lines were made level; what made "
        "them level is not in it."
    )
    mirrored: bool
    confidence: float | None = Field(ge=0, le=1, description="null: no text was read.")
    photo_rotation_deg: float | None = Field(
        default=None,
        ge=0,
        lt=360,
        description="Clockwise turn of the flat page against the photo (of a mirrored page: the mirrored photo), all "
        "in all; null for a mosaic.",
    )


class Size(Answer):
    """Size in pixels."""

    width: int = Field(ge=1)
    height: int = Field(ge=1)


class Mesh(Answer):
    """`source[r][c]` is the photo point shown at output pixel (c (width-1)/(columns-1), r (height-1)/(rows-1))."""

    rows: int = Field(ge=2)
    columns: int = Field(ge=2)
    source: list[list[Point]]


Corners = Annotated[
    list[Point | None],
    Field(
        min_length=4,
        max_length=4,
        description="Corners of the sheet in the photo, clockwise from the top left of the flat page; null: not seen.",
    ),
]


Embedded = Annotated[str | None, Field(description="The image in base64, if `embed` was set.")]
EmbeddedMediaType = Annotated[str | None, Field(description="Media type of `image`; null without it.")]


class FlatPage(Answer):
    """A flat page, and where it lies in the photo."""

    photo: Size = Field(description="Size of the photo after its EXIF rotation.")
    corners: Corners
    orientation: Orientation
    width: int = Field(ge=1)
    height: int = Field(ge=1)
    mesh: Mesh


FOUND = "What was found, where feedback has corrected it; absent where there is no difference."
"""Of the fields `found` of answers."""


def is_absent(found: object) -> bool:
    """Whether an answer leaves a field out."""
    return found is None


class Warning(Answer):
    """Remark on the quality of the result."""

    code: str
    detail: str
