"""What POST /mosaic takes and answers."""

import re
from typing import Annotated, Literal

from fastapi import UploadFile
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from app.schemas.options import (
    WRONG_NUMBER_OF_FILES,
    AskedFormat,
    Embed,
    Illumination,
    Quality,
    Switch,
    Upright,
)
from app.schemas.page import Answer, Orientation, Point, Warning
from services.contract.mosaic import FEWEST_PHOTOS, MOST_PHOTOS, Composition, MosaicParameters
from services.errors import InvalidOption

_INDEX = re.compile("[0-9]|1[0-5]")


def _enough_photos(images: list[UploadFile]) -> list[UploadFile]:
    if FEWEST_PHOTOS <= len(images) <= MOST_PHOTOS:
        return images
    advice = "; send a single photo to /rectify" if len(images) < FEWEST_PHOTOS else ""
    raise PydanticCustomError(
        WRONG_NUMBER_OF_FILES,
        "a mosaic is made of {fewest} to {most} photos of one page, not of {number}{advice}.",
        {"fewest": FEWEST_PHOTOS, "most": MOST_PHOTOS, "number": len(images), "advice": advice},
    )


def _base(value: object) -> object:
    """`auto`, or the number that a form's digits mean."""
    if value == "auto" or isinstance(value, int):
        return value
    if isinstance(value, str) and _INDEX.fullmatch(value):
        return int(value)
    raise ValueError(f"expected auto or the index of a photo, 0-{MOST_PHOTOS - 1}")


class MosaicForm(BaseModel):
    """The multipart form of POST /mosaic."""

    model_config = ConfigDict(extra="forbid")

    images: Annotated[list[UploadFile], AfterValidator(_enough_photos)] = Field(
        description="The photos, in any order, each a part of this name: JPEG, PNG, WebP, TIFF (first page) or "
        "HEIC/HEIF.",
        json_schema_extra={"minItems": FEWEST_PHOTOS, "maxItems": MOST_PHOTOS},
    )
    rectify: Switch = Field(
        default=True,
        description="false: the photos are flat already (scans); only shift, scale and a small turn differ.",
    )
    base: Annotated[
        Literal["auto"] | Annotated[int, Field(ge=0, le=MOST_PHOTOS - 1)], BeforeValidator(_base)
    ] = Field(
        default="auto",
        description="Photo, counted from 0, whose part of the page is shown when the photos fall into parts "
        "that do not connect; auto: the largest part.",
    )
    composition: Composition = Field(
        default="selective",
        description="Every word from the photo that shows it sharpest, or a feathered average (to compare).",
    )
    upright: Upright = True
    illumination: Illumination = "normalize"
    format: AskedFormat = None
    quality: Quality = None
    embed: Embed = False

    def parameters(self) -> MosaicParameters:
        """The options of the mosaic itself, without those of the answer's format.

        Raises
        ------
        InvalidOption
            When the base is none of the photos.
        """
        base = None if self.base == "auto" else self.base
        if base is not None and base >= len(self.images):
            raise InvalidOption(
                f"base: there is no photo {base}; {len(self.images)} were sent, counted from 0.", "base"
            )
        return MosaicParameters(
            rectify=self.rectify,
            base=base,
            composition=self.composition,
            illumination=self.illumination,
            upright=self.upright,
        )


class PatchMesh(Answer):
    """`target[r][c]` is the mosaic's point of photo pixel (c (width-1)/(columns-1), r (height-1)/(rows-1)).

    Where the photo looks past the page, it is the point of the nearest node that does not.
    """

    rows: int = Field(ge=2)
    columns: int = Field(ge=2)
    target: list[list[Point]]


class Patch(Answer):
    """What one photo gives to the page."""

    placed: bool
    mesh: PatchMesh | None = Field(description="null: not placed, as with all that follows.")
    scale: float | None = Field(description="Pixels of the mosaic per pixel of the photo, in its middle.")
    sharpness: float | None = Field(ge=0, le=1, description="Of its print; the sharpest photo's is 1.")


class Pair(Answer):
    """Two photos, `a` < `b`, that overlap, and the evidence for it."""

    a: int = Field(ge=0)
    b: int = Field(ge=0)
    matches: int = Field(ge=0, description="Candidate matches of features.")
    votes: int = Field(ge=0, description="Those in the largest group of one scale and displacement.")
    runner_up_votes: int = Field(ge=0, description="Those in the largest other group.")
    overlap_fraction: float = Field(description="Of the smaller photo's view.")
    residual_px: float = Field(ge=0, description="RMS distance of block matches, pixels of the mosaic.")


class MosaicResult(Answer):
    """The whole page, and the evidence for how it was put together."""

    width: int = Field(ge=1)
    height: int = Field(ge=1)
    base: int = Field(ge=0, description="The photo that the page was begun with.")
    orientation: Orientation
    patches: list[Patch] = Field(description="One for each photo, in the order of the upload.")
    pairs: list[Pair]
    unplaced: list[int] = Field(description="Photos that could not be placed; `warnings` say why.")
    warnings: list[Warning]
    timings_ms: dict[str, float]
    image: str | None = Field(default=None, description="base64, if `embed` was asked for.")
