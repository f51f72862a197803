"""The form of POST /layout, and its answers as the store keeps them."""

import re
from typing import Annotated, Any, Literal, cast

from fastapi import UploadFile
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from app.schemas.options import FORMAT, Absent, CallbackUrl, Language, Switch, Uploads
from services.contract.answers.layout import DocumentResult, LayoutResult
from services.contract.answers.tables import tables_of_document
from services.contract.layout import LayoutFormat
from services.contract.result_json import ClassJson, FoundClassJson, ResultJson, WholeResultJson

MODEL_NAME_PATTERN = "^[A-Za-z0-9_-][A-Za-z0-9._-]{0,59}$"
MOST_NAMES = 200
MOST_PAGE = 10_000
"""Largest page number that can be selected from a file, independent of the limit on a document's pages."""
NAMES_PATTERN = (
    f"^{MODEL_NAME_PATTERN.strip('^$')}(, ?{MODEL_NAME_PATTERN.strip('^$')}){{0,{MOST_NAMES - 1}}}$"
)


def parse_names(text: str) -> tuple[str, ...]:
    """The distinct names of a comma-separated list, in their order.

    Raises
    ------
    ValueError
        When one is not a valid model name, or there are too many.
    """
    names = [name.strip() for name in text.split(",")]
    if len(names) > MOST_NAMES or not all(re.fullmatch(MODEL_NAME_PATTERN, name) for name in names):
        raise ValueError(
            f"expected at most {MOST_NAMES} model names, separated by commas, each of 1-60 letters, digits, "
            "dots, underscores and hyphens (no dot first)"
        )
    return tuple(dict.fromkeys(names))


def checked_names(text: str) -> str:
    """The unchanged `text`; ValueError if it is not a list of model names."""
    parse_names(text)
    return text


def _as_text(schema: dict[str, Any]) -> None:
    """Document a field that may also be a file as text: generators make a plain argument of it."""
    schema.pop("anyOf", None)
    schema |= {"type": "string", "contentMediaType": "application/json"}


class LayoutForm(BaseModel):
    """Form of POST /layout: `image` (one or several), `zones` or `zones_file`, or `image` and one of them."""

    model_config = ConfigDict(extra="forbid")

    image: list[UploadFile] | Absent = Field(
        default=None,
        description="The page: JPEG, PNG, WebP, TIFF, HEIC/HEIF or PDF. The pages of a document: several parts of this "
        "name in their order, or a TIFF file or PDF of several pages.",
        json_schema_extra={"minItems": 1},
    )
    zones: UploadFile | str | Absent = Field(
        default=None,
        description='JSON `{"width", "height", "zones": [{"id", "box": [x0, y0, x1, y1], "font_size"?, "lines"?, '
        '"text"?, "kind"?}]}`, as a field or as a file: zones from another segmenter. With `image`, they are in '
        "pixels of the image.",
        json_schema_extra=_as_text,
    )
    zones_file: UploadFile | Absent = Field(
        default=None, description="Zones as a file of PAGE-XML, ALTO or JSON."
    )
    rectify: Switch = Field(
        default=False, description="Rectify the photo first; zones are then in pixels of the flat page."
    )
    ocr: Literal["auto", "off"] = Field(
        default="auto", description="auto: read the page if an OCR engine is installed."
    )
    language: Language = None
    models: Annotated[str, AfterValidator(checked_names)] | Absent = Field(
        default=None,
        description="The models to compare, separated by commas; default: all.",
        json_schema_extra={"pattern": NAMES_PATTERN},
    )
    format: Annotated[LayoutFormat | Absent, FORMAT] = Field(
        default=None,
        description="Format of the response; overrides `Accept`. png: the page with its labelled zones drawn on it. "
        "html: the text in elements by its labels, and pictures; one file for all pages. Several pages can also be "
        "json, or an archive (application/zip) with one pagexml or alto file per page.",
    )
    keep_image: Switch | Absent = Field(
        default=None,
        description="Keep the picture of the page with the result, for GET /layout/results/{id}/image. Default: by the "
        "setting KEEP_IMAGES (false, unless the operator has changed it).",
    )
    page: Annotated[int, Field(ge=1, le=MOST_PAGE)] | Absent = Field(
        default=None, description="Number, from 1, of the only page to recognize."
    )
    split: Switch = Field(
        default=False,
        description="The pages are a stack of documents: find where each begins. The answer is JSON, a `StackResult`.",
    )
    explain: Switch = Field(
        default=False,
        description="With JSON: list the terms of the cost, largest first, in `match.explanation`.",
    )
    words: Switch = Field(
        default=False,
        description="Add the words of every zone, each with its box and OCR confidence, to JSON, PAGE-XML and ALTO.",
    )
    callback_url: CallbackUrl = None
    upload: Uploads = []


def document_of(document: WholeResultJson, result_id: str, pages: list[LayoutResult]) -> DocumentResult:
    """Validated response for a worker's or the store's `document`, with its id and the results of its pages.

    Where a person has corrected the class of the first page, it is that of the document.
    """
    first = pages[0] if pages else None
    if first is not None and first.found is not None:
        chosen: ClassJson | None = None
        if first.class_ is not None:
            chosen = cast(ClassJson, first.class_.model_dump())
            chosen["name"] = first.document_class or chosen["name"]
        known = document["class"]
        chance = document["unknown_probability"] if known is None else known["probability"]
        found: FoundClassJson = {"class": None if known is None else known["name"], "probability": chance}
        document = {**document, "class": chosen, "found": found}
    tables = tables_of_document([page.tables for page in pages])
    return DocumentResult.model_validate({**document, "id": result_id, "pages": pages, "tables": tables})


def known_result(document: ResultJson) -> LayoutResult | None:
    """The answer that the store keeps, with an empty id; None where an old release has stored it in another form."""
    try:
        return result_of(document, "")
    except ValidationError:
        return None


def stored_form(answer: LayoutResult) -> ResultJson:
    """The answer as the store keeps it: without its id."""
    return cast(ResultJson, answer.model_dump(mode="json", exclude={"id"}))


def stored_whole(answer: DocumentResult) -> WholeResultJson:
    """The answer about a document as the store keeps it: without its id, and without its pages."""
    return cast(WholeResultJson, answer.model_dump(mode="json", exclude={"id", "pages"}))


def result_of(document: ResultJson, result_id: str) -> LayoutResult:
    """Validated response for a worker's or the store's `document`, with its id."""
    return LayoutResult.model_validate({"id": result_id, **document})
