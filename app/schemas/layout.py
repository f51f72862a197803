"""Request and response of POST /layout."""

import re
from typing import Annotated, Any, Literal

from fastapi import UploadFile
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from app.schemas.layout_samples import Appearance
from app.schemas.options import FORMAT, Absent, CallbackUrl, Language, Switch
from app.schemas.review import Decision
from services.contract.answers.page import Answer, FlatPage, Orientation, Warning
from services.contract.fields import FieldType, ValueProblem
from services.contract.layout import LayoutFormat

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
    explain: Switch = Field(
        default=False,
        description="With JSON: list the terms of the cost, largest first, in `match.explanation`.",
    )
    words: Switch = Field(
        default=False,
        description="Add the words of every zone, each with its box and OCR confidence, to JSON, PAGE-XML and ALTO.",
    )
    callback_url: CallbackUrl = None


class ReadWord(Answer):
    """A word that OCR read."""

    text: str
    box: tuple[float, float, float, float] = Field(description="x0, y0, x1, y1 in pixels of the page.")
    confidence: float = Field(ge=0, le=1)
    line: int = Field(ge=0, description="Line of the zone's `text`, from 0.")


class DocumentClass(Answer):
    """How well the page fits one model; for a document, how well its pages fit the models of a class.

    For a document, the version is that of the model of the first page, and the cost is the sum over the pages.
    """

    name: str
    model_version: Annotated[int, Field(ge=1)] | None = Field(
        description="null: a person named a class that had not been compared."
    )
    cost: float | None = Field(description="Least cost of matching the page with the model; null: as above.")
    probability: float = Field(ge=0, le=1, description="1 where a person has verified the class.")


class FoundZone(Answer):
    """What was found of a zone before a person corrected it."""

    label: str | None
    confidence: float = Field(ge=0, le=1)
    text: str


class FoundClass(Answer):
    """The class that was found before a person corrected it; null: none, with the probability that it is none."""

    model_config = ConfigDict(extra="forbid", validate_by_name=True, serialize_by_alias=True)

    class_: str | None = Field(alias="class")
    probability: float = Field(ge=0, le=1)


def _is_absent(found: object) -> bool:
    return found is None


_FOUND = "What was found, where feedback has corrected it; absent where there is no difference."


class LabelledZone(Answer):
    """One region of the page; null where a property was not measured."""

    id: str
    box: tuple[float, float, float, float] = Field(description="x0, y0, x1, y1 in pixels of the page.")
    label: str | None = Field(description="null: the zone has no label of the model, or there is no model.")
    confidence: float = Field(
        ge=0, le=1, description="Probability of the label, given the class; 1 where a person has verified it."
    )
    found: FoundZone | None = Field(default=None, exclude_if=_is_absent, description=_FOUND)
    group: str | None = Field(description="Label of the model node that the zone is grouped with.")
    order: int = Field(ge=0, description="Place in reading order, from 0.")
    kind: Literal["text", "figure", "rule", "noise"]
    lines: int | None
    font_size: float | None = Field(description="Em, pixels.")
    font_class: Literal["small", "normal", "large"] | None = Field(
        description="Relative to the rest of the page."
    )
    line_spacing: float | None = Field(description="Pixels from baseline to baseline.")
    weight: float | None = Field(description="Stroke width as a share of the font size.")
    alignment: Literal["left", "right", "centre", "justified"] | None
    appearance: Appearance | None = Field(default=None, description="Of the ink of the zone.")
    text: str
    text_confidence: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="Mean confidence of the words by their length; null: not read; 1 where a person gave the text.",
    )
    words: list[ReadWord] | None = Field(
        default=None, description="The words of the zone, in their order; null: not requested."
    )
    content: dict[str, float] = Field(description="Content features of the zone, each with a confidence 0-1.")


class LabelField(Answer):
    """The text of all zones of one label."""

    label: str
    text: str = Field(description="The texts of its zones in reading order, one below the other.")
    type: FieldType = Field(default="text", description="By the settings of the class.")
    value: str | None = Field(
        default=None,
        description="The text normalized by its type: a date as YYYY-MM-DD, an amount with a decimal "
        "point, a phone number as E.164, a text in one line; null: see `problem`.",
    )
    currency: str | None = Field(
        default=None, description="Currency of an amount (ISO 4217), if it is known."
    )
    problem: ValueProblem | None = Field(
        default=None,
        description="no-value: the text has no value of this type. several-values: it has different ones. ambiguous: a "
        "numeric date is one day by one order and another by the other (set `order`).",
    )
    confidence: float = Field(
        ge=0,
        le=1,
        description="Probability that the class, the labels of all its zones and the text of the value are right.",
    )
    zones: list[str] = Field(description="Ids of its zones.")


class CostTerm(Answer):
    """One term of the cost: of a zone, or (`other`) of a pair of zones."""

    zone: str
    other: str | None
    attribute: str
    cost: float


class KeptImage(Answer):
    """The picture of the page, a JPEG file, which GET /layout/results/{id}/image returns.

    It shows the whole page of the result, perhaps with fewer pixels.
    """

    width: int = Field(ge=1)
    height: int = Field(ge=1)
    bytes: int = Field(ge=1)


class MatchReport(Answer):
    """The match of the page with the model that gives its zones their labels."""

    cost: float
    node_cost: float
    edge_cost: float
    count_cost: float
    optimal: bool = Field(description="Proved to be the least cost.")
    gap: float = Field(ge=0, description="Upper bound of the cost above the least cost; 0 when optimal.")
    backbone: dict[str, str] = Field(description="For each label of the model the zone that fits it best.")
    explanation: list[CostTerm] | None = Field(
        description="Terms of the cost, largest first, at most a thousand; null: not requested."
    )


class LayoutResult(Answer):
    """Class of a document and labels of its zones.

    `class` is null when no model is stored, and when none of the compared models fits the page. In the second case
    `classes` and `unknown_probability` describe the comparison, and the zones have the labels of the best model.
    After feedback class, labels, texts, fields and decision are what the person verified.
    """

    model_config = ConfigDict(
        extra="forbid", allow_inf_nan=False, validate_by_name=True, serialize_by_alias=True
    )

    id: str = Field(description="Id of the result, as in /layout/results/{id}.")
    width: int | float = Field(gt=0, description="Pixels; an integer unless the zones were uploaded.")
    height: int | float = Field(gt=0)
    class_: DocumentClass | None = Field(alias="class")
    found: FoundClass | None = Field(default=None, exclude_if=_is_absent, description=_FOUND)
    classes: list[DocumentClass] = Field(description="All compared classes, most probable first.")
    unknown_probability: float = Field(
        ge=0,
        le=1,
        description="Probability that the page is of none of these classes; the sum with `classes` is 1.",
    )
    zones: list[LabelledZone]
    fields: list[LabelField] = Field(
        default=[],
        description="The text and the value of every label, in reading order; labels without a text are left out.",
    )
    match: MatchReport | None
    part: Literal["first", "continuation"] | None = Field(
        default=None,
        description="Part of the document; null: `class` is null, or the page is blank. The first of several pages is "
        "`first`; for a single page its model decides.",
    )
    document_class: str | None = Field(
        default=None,
        description="Class of the document of this page: `class.name`, or the class that this model continues.",
    )
    language: str | None = Field(
        default=None,
        description="The language in which OCR read the page, as Tesseract names it; null: not read.",
    )
    page: FlatPage | None = Field(
        default=None,
        description="With rectify=true: the flat page in whose pixels the zones are, and where it lies in the photo.",
    )
    orientation: Orientation | None = Field(
        default=None,
        description="How the image was turned, since it read so; places are those in the turned image. null: it was "
        "not looked for (zones were sent, nothing was read, or `page` has it).",
    )
    image: KeptImage | None = Field(
        default=None, description="The kept picture of the page; null: none is kept."
    )
    decision: Decision | None = Field(
        default=None,
        description="Whether the labels may be used without a person; null: no model was compared.",
    )
    warnings: list[Warning]
    timings_ms: dict[str, float]


class DocumentResult(Answer):
    """Class of a document of several pages, and a result for each page.

    A page's `class` is the model, among those of the document's class, that gives its labels; null when the page does
    not fit that class. Its `classes` are all models that were compared with the page.
    """

    model_config = ConfigDict(
        extra="forbid", allow_inf_nan=False, validate_by_name=True, serialize_by_alias=True
    )

    id: str = Field(
        description="Id of the result, as in /layout/results/{id}; feedback goes to the results of the pages."
    )
    class_: DocumentClass | None = Field(alias="class")
    found: FoundClass | None = Field(default=None, exclude_if=_is_absent, description=_FOUND)
    classes: list[DocumentClass] = Field(description="All compared classes, most probable first.")
    unknown_probability: float = Field(ge=0, le=1)
    pages: list[LayoutResult]
    warnings: list[Warning]
    timings_ms: dict[str, float] = Field(description="Of each stage, all pages together.")


def document_of(document: dict[str, Any], result_id: str, pages: list[LayoutResult]) -> DocumentResult:
    """Validated response for a worker's or the store's `document`, with its id and the results of its pages.

    Where a person has corrected the class of the first page, it is that of the document.
    """
    first = pages[0] if pages else None
    if first is not None and first.found is not None:
        chosen = None if first.class_ is None else first.class_.model_dump()
        if chosen is not None:
            chosen["name"] = first.document_class or chosen["name"]
        known = document["class"]
        chance = document["unknown_probability"] if known is None else known["probability"]
        found = {"class": None if known is None else known["name"], "probability": chance}
        document = {**document, "class": chosen, "found": found}
    return DocumentResult.model_validate({"id": result_id, "pages": pages, **document})


def result_of(document: dict[str, Any], result_id: str) -> LayoutResult:
    """Validated response for a worker's or the store's `document`, with its id."""
    return LayoutResult.model_validate({"id": result_id, **document})
