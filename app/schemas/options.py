"""Options that several requests have in common, and conversions of form and JSON values."""

from typing import Annotated

from pydantic import BeforeValidator, Field
from pydantic.json_schema import SkipJsonSchema

from services.contract import rectify
from services.contract.images import AnswerFormat, PagesFormat

WRONG_NUMBER_OF_FILES = "wrong_number_of_files"
"""Type of the validation error of a field with too few or too many files."""


def _switch(value: object) -> object:
    """The boolean of a form's `true` or `false`. Other spellings that pydantic accepts are refused."""
    if isinstance(value, str):
        if value.lower() not in {"true", "false"}:
            raise ValueError("expected true or false")
        return value.lower() == "true"
    return value


def _whole(value: object) -> object:
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _format(value: object) -> object:
    """A format in small letters; file extensions are accepted too."""
    if not isinstance(value, str):
        return value
    name = value.strip().lower()
    return {"jpg": "jpeg", "tif": "tiff"}.get(name, name)


FORMAT = BeforeValidator(_format)
"""Validator of `format`: `jpg` and any case are accepted."""
Switch = Annotated[bool, BeforeValidator(_switch)]
WHOLE = BeforeValidator(_whole)
"""Validator of an integer in JSON, which has no difference between 3.0 and 3. It must be the last annotation, because
the OpenAPI document otherwise lacks the bounds."""
Absent = SkipJsonSchema[None]
"""An absent field; a form has no null."""

Upright = Annotated[
    Switch,
    Field(
        description="Rotate (and mirror) the result so that the text is upright; false: only make the text lines "
        "horizontal."
    ),
]
Illumination = Annotated[
    rectify.Illumination,
    Field(description="Remove uneven light and shadow: dark text on white paper."),
]
AskedFormat = Annotated[
    AnswerFormat | Absent,
    FORMAT,
    Field(
        description="Format of the response; overrides `Accept`. Default: an image in the (first) photo's own format."
    ),
]
AskedPagesFormat = Annotated[
    PagesFormat | Absent,
    FORMAT,
    Field(
        description="Format of the response; overrides `Accept`. Default: an image in the photo's own format, or a PDF "
        "for several pages. `zip` has one image per page; `jpeg`, `png` and `webp` hold one page only."
    ),
]
Quality = Annotated[
    Annotated[int, Field(ge=1, le=100)] | Absent,
    Field(description="1-100, for lossy formats; default 90.", examples=[90]),
]
Embed = Annotated[Switch, Field(description="With JSON: include the image as base64 in `image`.")]
CallbackUrl = Annotated[
    Annotated[str, Field(max_length=2000)] | Absent,
    Field(
        description="With `Prefer: respond-async`: where the service sends the job's state at its end, signed as "
        "Standard Webhooks says. The host must be one of CALLBACK_HOSTS.",
        examples=["https://hooks.example.org/documents"],
    ),
]
