"""Options that requests share, and how a form says true, false and nothing, and JSON a whole number."""

from typing import Annotated

from pydantic import BeforeValidator, Field
from pydantic.json_schema import SkipJsonSchema

from services.contract import rectify
from services.contract.images import AnswerFormat, PagesFormat

WRONG_NUMBER_OF_FILES = "wrong_number_of_files"
"""Type of the validation error of a field that holds too few or too many files."""


def _switch(value: object) -> object:
    """A form's `true` or `false`, and none of the other words that may be taken for them."""
    if isinstance(value, str):
        if value.lower() not in {"true", "false"}:
            raise ValueError("expected true or false")
        return value.lower() == "true"
    return value


def _whole(value: object) -> object:
    return int(value) if isinstance(value, float) and value.is_integer() else value


Switch = Annotated[bool, BeforeValidator(_switch)]
WHOLE = BeforeValidator(_whole)
"""Of an integer in JSON, which does not tell 3.0 from 3; stands last, else the bounds are not documented."""
Absent = SkipJsonSchema[None]
"""A field that was left out; a form has no null."""

Upright = Annotated[
    Switch,
    Field(
        description="Turn (and un-mirror) the result so that it reads; false leaves the text lines "
        "horizontal, whichever way up."
    ),
]
Illumination = Annotated[
    rectify.Illumination,
    Field(description="Even out light and shadow to dark ink on white paper."),
]
AskedFormat = Annotated[
    AnswerFormat | Absent,
    Field(
        description="What comes back; overrides `Accept`. Neither: an image in the (first) photo's own format."
    ),
]
AskedPagesFormat = Annotated[
    PagesFormat | Absent,
    Field(
        description="What comes back; overrides `Accept`. Neither: an image in the photo's own format, and several "
        "pages as a PDF. `zip` has an image a page; `jpeg`, `png` and `webp` hold one page only."
    ),
]
Quality = Annotated[
    Annotated[int, Field(ge=1, le=100)] | Absent, Field(description="1-100, for lossy formats.")
]
Embed = Annotated[Switch, Field(description="With JSON: include the image as base64 in `image`.")]
