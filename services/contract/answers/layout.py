"""Answers of POST /layout: the class of a page or a document, and the labels of zones."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from services.contract.answers.page import FOUND, Answer, FlatPage, Orientation, Warning, is_absent
from services.contract.answers.tables import DocumentTable, ItemTable
from services.contract.fields import FieldType, ValueProblem


class Appearance(BaseModel):
    """How the ink of a zone looks: print is even and stands on baselines, handwriting and stamps are not."""

    density: float = Field(description="Share of the box that is ink.")
    size: float = Field(description="Mean height of its connected components over the page's glyph height.")
    size_spread: float = Field(description="Standard deviation of the binary logarithm of their heights.")
    stroke: float = Field(description="Mean stroke width over that of the page's print.")
    slant: float = Field(description="How far strokes lean to the right, by height.")
    regularity: float = Field(description="Share of components on one baseline with a neighbour.")


class DecisionReason(Answer):
    """Why a page should be reviewed."""

    code: Literal["no-class", "no-evidence", "unsure", "product-differs", "sum-differs"]
    detail: str
    zones: list[str] = Field(description="Ids of the zones that it is about; empty: the whole page.")


class Decision(Answer):
    """Whether the labels may be used without a person, by the feedback so far when the page was recognized."""

    action: Literal["accept", "review"]
    tolerated_error: float = Field(
        description="Largest share of wrong zones among accepted ones, as the operator states it (TOLERATED_ERRORS)."
    )
    reasons: list[DecisionReason]


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

    class_: str | None = Field(validation_alias="class", serialization_alias="class")
    probability: float = Field(ge=0, le=1)


class LabelledZone(Answer):
    """One region of the page; null where a property was not measured."""

    id: str
    box: tuple[float, float, float, float] = Field(description="x0, y0, x1, y1 in pixels of the page.")
    label: str | None = Field(description="null: the zone has no label of the model, or there is no model.")
    confidence: float = Field(
        ge=0, le=1, description="Probability of the label, given the class; 1 where a person has verified it."
    )
    found: FoundZone | None = Field(default=None, exclude_if=is_absent, description=FOUND)
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


FileName = Annotated[
    str | None,
    Field(
        max_length=200,
        description="Name of the uploaded image, of a document of the first one, without folders; null: no image came, "
        "or none with a name.",
    ),
]


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
    file_name: FileName = None
    width: int | float = Field(gt=0, description="Pixels; an integer unless the zones were uploaded.")
    height: int | float = Field(gt=0)
    class_: DocumentClass | None = Field(validation_alias="class", serialization_alias="class")
    found: FoundClass | None = Field(default=None, exclude_if=is_absent, description=FOUND)
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
    tables: list[ItemTable] = Field(
        default=[],
        description="Tables of items, from the top down, where the settings of the class name columns (`items`). A "
        "person's other class leaves none.",
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
    file_name: FileName = None
    class_: DocumentClass | None = Field(validation_alias="class", serialization_alias="class")
    found: FoundClass | None = Field(default=None, exclude_if=is_absent, description=FOUND)
    classes: list[DocumentClass] = Field(description="All compared classes, most probable first.")
    unknown_probability: float = Field(ge=0, le=1)
    pages: list[LayoutResult]
    tables: list[DocumentTable] = Field(
        default=[], description="Tables of items; one that goes on over several pages is one table."
    )
    warnings: list[Warning]
    timings_ms: dict[str, float] = Field(description="Of each stage, all pages together.")


class StackResult(Answer):
    """The documents of a stack of pages, in their order; each is a result of its own."""

    documents: list[DocumentResult]
