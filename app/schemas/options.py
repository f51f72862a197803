"""Options that several requests have in common, and conversions of form and JSON values."""

import re
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, StringConstraints
from pydantic.config import JsonDict
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import CoreSchema, core_schema

from services.contract import rectify
from services.contract.cameras import CAMERA_PATTERN
from services.contract.images import (
    AnswerFormat,
    ArchiveContent,
    EmbeddedFormat,
    ImageLimits,
    PagesFormat,
    PdfVersion,
)

WRONG_NUMBER_OF_FILES = "wrong_number_of_files"
"""Type of the validation error of a field with too few or too many files."""


def _switch(value: object) -> object:
    """The boolean of a form's `true` or `false`. Other spellings that pydantic accepts are refused."""
    if isinstance(value, str):
        if value.lower() not in {"true", "false"}:
            raise ValueError("expected true or false")
        return value.lower() == "true"
    if isinstance(value, int | float) and not isinstance(value, bool):
        raise ValueError("expected true or false")
    return value


def _number(value: object) -> object:
    """A number; JSON's true is none."""
    if isinstance(value, bool):
        raise ValueError("expected a number")
    return value


def _whole(value: object) -> object:
    return int(value) if isinstance(value, float) and value.is_integer() else value


@dataclass(frozen=True, slots=True)
class Written:
    """How a text is written. A wrong one is refused with a sentence; the pattern is for the OpenAPI document."""

    pattern: str
    expected: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self._checked, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {**handler(schema), "pattern": self.pattern}

    def _checked(self, text: str) -> str:
        if not re.fullmatch(self.pattern, text):
            raise ValueError(f"expected {self.expected}")
        return text


def _format(value: object) -> object:
    """A format in small letters; file extensions are accepted too."""
    if not isinstance(value, str):
        return value
    name = value.strip().lower()
    return {"jpg": "jpeg", "tif": "tiff", "text": "txt", "md": "markdown"}.get(name, name)


FORMAT = BeforeValidator(_format)
"""Validator of `format`: `jpg` and any case are accepted."""
NUMBER = BeforeValidator(_number)
Switch = Annotated[bool, BeforeValidator(_switch)]
WHOLE = BeforeValidator(_whole)
"""Validator of an integer in JSON, which has no difference between 3.0 and 3. It must be the last annotation, because
the OpenAPI document otherwise lacks the bounds."""
Absent = SkipJsonSchema[None]
"""An absent field; a form has no null."""

TURN = "auto|0|90|180|270"
"""Pattern of `rotate`."""
TURNS_PATTERN = f"^(({TURN})(,({TURN}))*)?$"
"""Pattern of `rotate` for several pages. An empty field counts as absent, as for every field of a form."""


def checked_turns(value: object) -> object:
    """`rotate` in small letters and without blanks; refused unless every entry is `auto` or a quarter turn."""
    if not isinstance(value, str):
        return value
    entries = value.lower().replace(" ", "") or "auto"
    if re.fullmatch(TURNS_PATTERN, entries) is None:
        raise ValueError("expected auto, 0, 90, 180 or 270, or one of them for each page as auto,90,auto")
    return entries


def turn_of(entry: str) -> rectify.Rotation | None:
    """The clockwise degrees of an entry of `rotate`; None for `auto`."""
    turns: dict[str, rectify.Rotation] = {"0": 0, "90": 90, "180": 180, "270": 270}
    return turns.get(entry)


def files_may_be_uploads(schema: JsonDict) -> None:
    """Document that a form needs some part, but no file: uploads may stand for them."""
    schema.pop("required", None)
    schema["minProperties"] = 1


Upright = Annotated[
    Switch,
    Field(
        description="Rotate (and mirror) the result so that the text is upright; false: only make the text lines "
        "horizontal."
    ),
]
Illumination = Annotated[
    rectify.Illumination,
    Field(
        description="normalize: remove uneven light and shadow: dark text on white paper; gray: the same in gray; "
        "bw: in black and white, Group 4 in PDFs and TIFF files."
    ),
]
AskedFormat = Annotated[
    AnswerFormat | Absent,
    FORMAT,
    Field(
        description="Format of the response; overrides `Accept`. Default: an image in the (first) photo's own format. "
        "`hocr`, `alto`, `txt` and `markdown` are the text of the page."
    ),
]
AskedPagesFormat = Annotated[
    PagesFormat | Absent,
    FORMAT,
    Field(
        description="Format of the response; overrides `Accept`. Default: an image in the photo's own format, or a PDF "
        "for several pages. `zip` has one image per page; `jpeg`, `png` and `webp` hold one page only; `hocr`, `alto`, "
        "`txt` and `markdown` are the text of the pages."
    ),
]
ReadText = Annotated[
    Switch,
    Field(
        description="Read the page: `text` in JSON has the words with their places, and a PDF gets an invisible text "
        "layer, so that it can be searched. The formats hocr, alto, txt and markdown imply it."
    ),
]
LANGUAGE_PATTERN = r"^([A-Za-z]{2,12}(_[A-Za-z]{2,12}){0,2}(\+[A-Za-z]{2,12}(_[A-Za-z]{2,12}){0,2}){0,7})?$"
Language = Annotated[
    Annotated[
        str,
        StringConstraints(max_length=120),
        Written(
            LANGUAGE_PATTERN,
            "1 to 8 names of languages of Tesseract, of letters and _, joined by + as eng+fra",
        ),
    ]
    | Absent,
    Field(
        description="Language of the text as Tesseract names it, several joined by `+`: `eng`, `deu`, `eng+fra`. "
        "Default: the first of OCR_LANGUAGES.",
        examples=["eng"],
    ),
]
CameraName = Annotated[
    Annotated[
        str,
        Written(
            CAMERA_PATTERN,
            "1-100 letters (a to z), digits, spaces, dots, underscores and hyphens, no sign first, as tablet-3",
        ),
    ]
    | Absent,
    Field(
        description="Name of the camera, any token: the focal length that its pages show is remembered, and used where "
        "a page does not show it. Default: make, model and size of the photo by EXIF.",
    ),
]
Title = Annotated[
    Annotated[str, StringConstraints(max_length=300)] | Absent,
    Field(description="Title of a PDF or hOCR file; default: the file name of the (first) photo."),
]
AskedPdfVersion = Annotated[
    PdfVersion,
    Field(description="Version of a PDF: 1.7, or a-2b for archives (PDF/A-2b, ISO 19005-2)."),
]
AskedArchive = Annotated[
    ArchiveContent,
    Field(
        description="What an archive (format=zip) has of every page: its image, its JSON description (page-01.json; "
        "the problem of a page that failed), or both."
    ),
]
Quality = Annotated[
    Annotated[int, Field(ge=1, le=100), NUMBER] | Absent,
    Field(description="1-100, for lossy formats; default 90.", examples=[90]),
]
Embed = Annotated[Switch, Field(description="With JSON: include the image as base64 in `image`.")]
EmbedFormat = Annotated[
    EmbeddedFormat | Absent,
    FORMAT,
    Field(
        description="With JSON: the format of the image in `image`, which is then included (as by embed=true). "
        "Default: the photo's own format."
    ),
]
MaxPixels = Annotated[
    Annotated[int, Field(ge=1, le=ImageLimits().max_side_px), NUMBER] | Absent,
    Field(
        description="Largest size of the picture in pixels, for previews: it is reduced, never enlarged, and keeps its "
        "proportions. Sizes and meshes in the response are those of the smaller picture."
    ),
]
Uploads = Annotated[
    list[str],
    Field(
        description="Ids of complete uploads (/uploads), in place of files: a part of this name for each. Their files "
        "take the places of these parts.",
    ),
]
"""The route finds files in place of the ids: `UploadFormRoute`."""
KeptPages = Annotated[
    list[str],
    Field(
        description="Ids of kept pages (/pages), in place of files: a part of this name for each. Their photos take "
        "the places of these parts.",
    ),
]
"""The route finds files in place of the ids: `UploadFormRoute`."""
CallbackUrl = Annotated[
    Annotated[str, Field(max_length=2000)] | Absent,
    Field(
        description="With `Prefer: respond-async`: where the service sends the job's state at its end, signed as "
        "Standard Webhooks says. The host must be one of CALLBACK_HOSTS.",
        examples=["https://hooks.example.org/documents"],
    ),
]
