"""Results of /layout as the store keeps them: what is read of them again.

`services.contract.answers.layout` has all of their keys, and their meaning. An earlier release may have kept fewer.
"""

from collections.abc import Mapping
from typing import Literal, NotRequired, TypedDict

from services.contract.page_json import PageJson


class ClassJson(TypedDict):
    """How well a page fits one model: `DocumentClass`."""

    name: str
    model_version: int | None
    cost: float | None
    probability: float


class WordJson(TypedDict):
    """`ReadWord`."""

    text: str
    box: list[float]
    confidence: float
    line: int


class FoundZoneJson(TypedDict):
    """`FoundZone`."""

    label: str | None
    confidence: float
    text: str


class LabelledZoneJson(TypedDict):
    """`LabelledZone`."""

    id: str
    box: list[float]
    label: str | None
    confidence: float
    found: NotRequired[FoundZoneJson]
    group: str | None
    order: int
    kind: Literal["text", "figure", "rule", "noise"]
    text: str
    text_confidence: NotRequired[float | None]
    words: NotRequired[list[WordJson] | None]
    content: dict[str, float]


class FieldJson(TypedDict):
    """`LabelField`."""

    label: str
    text: str
    type: str
    value: str | None
    currency: str | None
    problem: str | None
    confidence: float
    zones: list[str]


class FoundCellJson(TypedDict):
    """`FoundCell`."""

    text: str
    confidence: float


class CellJson(TypedDict):
    """`ItemCell`."""

    box: list[float]
    text: str
    value: str | None
    currency: str | None
    problem: str | None
    confidence: float
    found: NotRequired[FoundCellJson]


class TableJson(TypedDict):
    """`ItemTable`."""

    columns: list[str]
    types: list[str]
    headers: list[str | None]
    box: list[float]
    rows: list[list[CellJson | None]]
    checks: Mapping[str, object]


class PictureJson(TypedDict):
    """`KeptImage`."""

    width: int
    height: int
    bytes: int


_FoundClass = TypedDict("_FoundClass", {"class": str | None})
_Compared = TypedDict("_Compared", {"class": ClassJson | None})


class FoundClassJson(_FoundClass):
    """`FoundClass`."""

    probability: float


class ReasonJson(TypedDict):
    """`DecisionReason`."""

    code: str
    detail: str
    zones: list[str]


class DecisionJson(TypedDict):
    """`Decision`."""

    action: str
    tolerated_error: float
    reasons: list[ReasonJson]


class RecognitionJson(_Compared):
    """What a recognition says of a page besides its picture, warnings and timings; nothing in `match` is read."""

    classes: list[ClassJson]
    unknown_probability: float
    zones: list[LabelledZoneJson]
    fields: list[FieldJson]
    tables: NotRequired[list[TableJson]]
    match: object
    part: str | None
    document_class: str | None


class ResultJson(RecognitionJson):
    """`LayoutResult`, without its id."""

    width: float
    height: float
    file_name: NotRequired[str | None]
    found: NotRequired[FoundClassJson]
    page: NotRequired[object]
    image: NotRequired[PictureJson | None]
    decision: NotRequired[DecisionJson | None]


class WholeResultJson(_Compared):
    """`DocumentResult`, without its id and its pages."""

    classes: list[ClassJson]
    unknown_probability: float
    found: NotRequired[FoundClassJson]


class RecognizedJson(TypedDict):
    """A page as it was recognized: its result, and the page with all that was measured."""

    page: PageJson
    result: ResultJson
    review: NotRequired[dict[str, float | str | None]]
    """Its place in the review queue then, by the fields of `ReviewDraft`."""


class StoredResultJson(TypedDict, total=False):
    """What is stored of a page, or of a document of several pages.

    A page has `page` and `result`, as a person has verified them; then `recognized` is what was found before. Of a
    document's page, `in_document` is the document's id; True: an earlier release kept it. A document has `document`
    and the ids of its `pages`.
    """

    page: PageJson
    result: ResultJson
    recognized: RecognizedJson
    in_document: str | bool
    document: WholeResultJson
    pages: list[str]
