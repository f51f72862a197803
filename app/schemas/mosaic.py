"""The form of POST /mosaic."""

import re
from typing import Annotated, Any, Literal

from fastapi import UploadFile
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from app.schemas.options import (
    TURN,
    WRONG_NUMBER_OF_FILES,
    AskedFormat,
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
from services.contract.mosaic import FEWEST_PHOTOS, MOST_PHOTOS, Composition, MosaicParameters
from services.errors import InvalidOption

_INDEX = re.compile("[0-9]|1[0-5]")
BASE_PATTERN = f"^(auto|{_INDEX.pattern})$"


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
    """`auto`, or the integer that a form sends as digits."""
    if value == "auto" or isinstance(value, int):
        return value
    if isinstance(value, str) and _INDEX.fullmatch(value):
        return int(value)
    raise ValueError(f"expected auto or the index of a photo, 0-{MOST_PHOTOS - 1}")


def _as_text(schema: dict[str, Any]) -> None:
    """Document `base` as the text that a form sends; generators cannot handle a union with a constant."""
    schema.pop("anyOf", None)
    schema |= {"type": "string", "pattern": BASE_PATTERN}


def _one_turn(turns: str) -> str:
    if "," in turns:
        raise ValueError("expected auto, 0, 90, 180 or 270: a mosaic is one page")
    return turns


class MosaicForm(BaseModel):
    """The multipart form of POST /mosaic."""

    model_config = ConfigDict(extra="forbid", json_schema_extra=files_may_be_uploads)

    images: Annotated[list[UploadFile], AfterValidator(_enough_photos)] = Field(
        description="The photos, in any order, each a part of this name: JPEG, PNG, WebP, TIFF (first page) or "
        "HEIC/HEIF.",
        json_schema_extra={"minItems": FEWEST_PHOTOS, "maxItems": MOST_PHOTOS},
    )
    rectify: Switch = Field(
        default=True,
        description="false: the photos are already flat (scans) and differ by shift, scale and a small rotation only.",
    )
    base: Annotated[
        Literal["auto"] | Annotated[int, Field(ge=0, le=MOST_PHOTOS - 1)], BeforeValidator(_base)
    ] = Field(
        default="auto",
        description="Index, from 0, of a photo. If the photos form parts that do not connect, the response shows the "
        "part with this photo; auto: the largest part.",
        json_schema_extra=_as_text,
    )
    composition: Composition = Field(
        default="selective",
        description="selective: each word from the sharpest photo; else a feathered average, for comparison.",
    )
    upright: Upright = True
    rotate: Annotated[str, BeforeValidator(checked_turns), AfterValidator(_one_turn)] = Field(
        default="auto",
        description="Clockwise turn of the page in degrees, in place of the one that `upright` finds: auto, 0, 90, 180 "
        "or 270.",
        json_schema_extra={"pattern": f"^({TURN})?$"},
    )
    illumination: Illumination = "normalize"
    keep_photo: Switch = Field(
        default=False,
        description="Keep the joined page for later answers: the response has `page_id` (header `Document-Page-Id`), "
        "see /pages. The photos are not kept.",
    )
    camera: CameraName = None
    text: ReadText = False
    language: Language = None
    format: AskedFormat = None
    quality: Quality = None
    embed: Embed = False
    embed_format: EmbedFormat = None
    max_width: MaxPixels = None
    max_height: MaxPixels = None
    pdf_version: AskedPdfVersion = "1.7"
    title: Title = None
    callback_url: CallbackUrl = None
    upload: Uploads = []

    def parameters(self) -> MosaicParameters:
        """The options of the mosaic, without those of the response format.

        Raises
        ------
        InvalidOption
            When `base` is not the index of a photo.
        """
        base = None if self.base == "auto" else self.base
        if base is not None and base >= len(self.images):
            raise InvalidOption(
                f"base: there is no photo {base}; {len(self.images)} photos were sent, counted from 0.",
                "base",
            )
        return MosaicParameters(
            rectify=self.rectify,
            base=base,
            composition=self.composition,
            illumination=self.illumination,
            upright=self.upright,
            text=self.text,
            language=self.language or None,
            camera=self.camera or None,
            rotate=turn_of(self.rotate),
            keep_photo=self.keep_photo,
        )
