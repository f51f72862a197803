"""Layout graph models as JSON documents with a format version; documents from outside are checked.

The sufficient statistics of a model are its key `memory`: stored documents and the HTTP contract have that name.
"""

from typing import Annotated, Any, NotRequired, TypeVar, cast

from pydantic import AfterValidator, BeforeValidator, FailFast, Field, TypeAdapter, ValidationError
from typing_extensions import TypedDict  # of typing's own pydantic cannot read the optional keys before 3.12

from services.contract.fields import MOST_COLUMNS
from services.contract.layout import LONGEST_LABEL
from services.contract.model_json import ModelJson
from services.layout.model.layout_model import (
    LARGEST,
    LARGEST_SUM,
    LEAST_VARIANCE,
    MODEL_FORMAT,
    MODEL_FORMAT_VERSION,
    MOST_BIAS,
    MOST_LABELS,
    MOST_WEIGHT,
    Calibration,
    EdgeStatistics,
    LayoutModel,
    ModelEdge,
    ModelNode,
    ModelStatistics,
    NodeStatistics,
    NodeWords,
    NumericExpectation,
    PieceStatistics,
)
from services.layout.model.word_counts import MOST_KEPT
from services.layout.page import InvalidLayout, is_finite_number
from services.layout.tables.table_model import (
    MOST_HEADER_WORDS,
    MOST_PRODUCTS,
    ColumnModel,
    ProductRule,
    TableModel,
)

MOST_NAMES = 500
"""Of attributes, in one mapping."""
MOST_DESCRIPTORS = 100
LONGEST_NAME = 100


def model_to_document(model: LayoutModel) -> ModelJson:
    """`model` as JSON can hold it; `model_from_document` reads it back."""
    places = {node.label: place for place, node in enumerate(model.nodes)}
    document = _PLAIN.dump_python(model, mode="json", warnings="none")
    statistics = document.pop("statistics")
    for edge in (*document["edges"], *(statistics["edges"] if statistics else ())):
        edge["upper"], edge["lower"] = places[edge["upper"]], places[edge["lower"]]
    head = {"format": MODEL_FORMAT, "format_version": MODEL_FORMAT_VERSION}
    return cast(ModelJson, {**head, **document, "memory": statistics})


def model_from_document(document: Any) -> LayoutModel:
    """The model that a document describes.

    Raises
    ------
    InvalidLayout
        When it is not a layout graph model, one of a newer form, or damaged; the field is named.
    """
    if not isinstance(document, dict) or document.get("format") != MODEL_FORMAT:
        raise InvalidLayout(
            f"format: this is not a {MODEL_FORMAT}. Send what GET /layout/models/{{name}} answers.", "format"
        )
    version = document.get("format_version")
    if version != MODEL_FORMAT_VERSION or isinstance(version, bool):
        shown = f"{version:g}" if is_finite_number(version) else "this one"
        raise InvalidLayout(
            f"format_version: this service reads version {MODEL_FORMAT_VERSION}, not {shown}. "
            "Export the model from a service of the same release, or initialize it again from samples.",
            "format_version",
        )
    try:
        read = _MODEL.validate_python(document)
    except ValidationError as error:
        raise _invalid(error) from error
    labels = [node.get("label") for node in read["nodes"]]
    if not labels or labels[0] is not None:
        raise InvalidLayout("nodes: the first node must be null, with label null.", "nodes")
    if len(set(labels)) != len(labels):
        raise InvalidLayout("nodes: every label may occur once.", "nodes")
    edges = tuple(
        ModelEdge(*_ends(edge, labels, f"edges[{k}]"), edge["costs"]) for k, edge in enumerate(read["edges"])
    )
    if len({(edge.upper, edge.lower) for edge in edges}) != len(edges):
        raise InvalidLayout("edges: every pair of labels may occur once.", "edges")
    statistics = read.get("memory")
    return LayoutModel(
        name=read["name"],
        samples=read["samples"],
        nodes=tuple(_node(node) for node in read["nodes"]),
        edges=edges,
        scales=read["scales"],
        calibration=Calibration(**read["calibration"]),
        statistics=None if statistics is None else _statistics(statistics, labels),
        table=None if (table := read.get("table")) is None else _table(table),
    )


def _whole(number: Any) -> Any:
    """A whole number as an int: JSON does not distinguish 3.0 from 3."""
    return int(number) if isinstance(number, float) and number.is_integer() else number


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("expected printable characters")
    return text


def _stripped(text: str) -> str:
    """A label that zones of samples may have too, so that what is recognized can be sent as a sample."""
    if text != text.strip():
        raise ValueError("expected no blanks around the label")
    return text


def _not_larger(sums: tuple[float, float]) -> tuple[float, float]:
    if sums[1] > sums[0] * (1 + 1e-6):
        raise ValueError("expected a count and a sum that is not larger")
    return sums


def _between(least: float, largest: float) -> Any:
    """Bounds of a number; strict: no text and no truth value is one. NaN is within no bounds."""
    return Field(ge=least, le=largest, strict=True, allow_inf_nan=False)


Number = Annotated[float, _between(-LARGEST, LARGEST)]
Positive = Annotated[float, _between(0.0, LARGEST)]
Count = Annotated[int, Field(ge=0, le=LARGEST, strict=True), BeforeValidator(_whole)]
Weight = Annotated[float, _between(0.0, MOST_WEIGHT)]
Bias = Annotated[float, _between(-MOST_BIAS, MOST_BIAS)]
Confidence = Annotated[float, _between(0.0, 1.0)]
Total = Annotated[float, _between(0.0, LARGEST_SUM)]
SignedTotal = Annotated[float, _between(-LARGEST_SUM, LARGEST_SUM)]
Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME, strict=True), AfterValidator(_printable)]
Label = Annotated[Name, Field(max_length=LONGEST_LABEL), AfterValidator(_stripped)]
T = TypeVar("T")
# Long lists are refused at their first defect: errors about all of a large document would fill the memory.
ByName = Annotated[dict[Name, T], Field(max_length=MOST_NAMES)]
Row = Annotated[tuple[T, ...], Field(max_length=MOST_DESCRIPTORS), FailFast()]
LongRow = Annotated[tuple[T, ...], Field(max_length=MOST_NAMES), FailFast()]
Nodes = Annotated[list[T], Field(max_length=MOST_LABELS + 1)]
Edges = Annotated[list[T], Field(max_length=(MOST_LABELS + 1) ** 2), FailFast()]


class _Ends(TypedDict):
    upper: Positive
    lower: Positive


class _Expectation(TypedDict):
    value: Number
    variance: Annotated[float, _between(LEAST_VARIANCE, LARGEST)]
    weight: NotRequired[Weight]


class _Pieces(TypedDict):
    joining: Bias
    certainty: Positive
    whole: Positive
    divided: Positive
    widths: tuple[Total, SignedTotal, Total]
    heights: tuple[Total, SignedTotal, Total]
    merged: NotRequired[Positive]
    apart: NotRequired[Positive]
    within: NotRequired[Positive]


class _Words(TypedDict):
    zones: Positive
    tokens: Annotated[dict[Name, Positive], Field(max_length=MOST_KEPT)]


class _Node(TypedDict):
    label: NotRequired[Label | None]
    zones: Positive
    cost: Number
    numeric: ByName[_Expectation]
    content: ByName[Confidence]
    count_costs: Annotated[Row[Number], Field(min_length=2)]
    content_weights: NotRequired[ByName[Weight]]
    joining: NotRequired[Bias]
    pieces: NotRequired[_Pieces]
    words: NotRequired[ByName[_Words]]


class _Edge(_Ends):
    costs: ByName[Row[Number]]


class _Calibration(TypedDict):
    mean: Number
    deviation: Annotated[float, _between(1e-6, LARGEST)]
    pages: Count
    bias: NotRequired[Bias]
    evidence_slope: NotRequired[Bias]
    evidence_intercept: NotRequired[Bias]
    evidence_zones: NotRequired[Count]


class _NodeStatistics(TypedDict):
    zones: Total
    numeric: ByName[tuple[Total, SignedTotal, Total]]
    content: ByName[Annotated[tuple[Total, Total], AfterValidator(_not_larger)]]
    counts: Row[Total]


class _EdgeStatistics(_Ends):
    seen: LongRow[Total]


class _Statistics(TypedDict):
    pages: Total
    descriptors: LongRow[Name]
    nodes: Nodes[_NodeStatistics]
    edges: Edges[_EdgeStatistics]
    certainty: ByName[Positive]


class _Column(TypedDict):
    label: Label
    samples: Positive
    cells: Positive
    rows: Positive
    headers: Annotated[dict[Name, Positive], Field(max_length=MOST_HEADER_WORDS)]
    kinds: ByName[Positive]
    left: tuple[Total, SignedTotal, Total]
    right: tuple[Total, SignedTotal, Total]
    sizes: tuple[Total, SignedTotal, Total]


class _Product(TypedDict):
    of: Label
    by: Label
    gives: Label
    tested: Positive
    fits: Positive


class _Table(TypedDict):
    columns: Annotated[list[_Column], Field(min_length=1, max_length=MOST_COLUMNS)]
    samples: Positive
    at_top: Positive
    at_bottom: Positive
    products: Annotated[list[_Product], Field(max_length=MOST_PRODUCTS)]


class _Model(TypedDict):
    name: Name
    samples: Count
    nodes: Nodes[_Node]
    edges: Edges[_Edge]
    scales: ByName[Weight]
    calibration: _Calibration
    memory: NotRequired[_Statistics | None]
    table: NotRequired[_Table | None]


_MODEL = TypeAdapter(_Model)
_PLAIN = TypeAdapter(LayoutModel)


def _node(read: _Node) -> ModelNode:
    numeric = {name: NumericExpectation(**each) for name, each in read["numeric"].items()}
    values: dict[str, Any] = {"label": None, **read, "numeric": numeric}
    joining = values.pop("joining", 0.0)  # all that models of earlier releases know of pieces
    pieces = PieceStatistics(**read["pieces"]) if "pieces" in read else PieceStatistics(joining)
    words = {name: NodeWords(**each) for name, each in read.get("words", {}).items()}
    return ModelNode(**{**values, "pieces": pieces, "words": words})


def _table(read: _Table) -> TableModel:
    labels = [column["label"] for column in read["columns"]]
    if len(set(labels)) < len(labels):
        raise InvalidLayout("table.columns: every label may occur once.", "table.columns")
    return TableModel(
        tuple(ColumnModel(**column) for column in read["columns"]),
        read["samples"],
        read["at_top"],
        read["at_bottom"],
        tuple(ProductRule(**rule) for rule in read["products"]),
    )


def _statistics(read: _Statistics, labels: list[str | None]) -> ModelStatistics:
    if len(read["nodes"]) != len(labels):
        raise InvalidLayout("memory.nodes: one is needed for each of the model's nodes.", "memory.nodes")
    edges = []
    for k, edge in enumerate(read["edges"]):
        where = f"memory.edges[{k}]"
        if len(edge["seen"]) != len(read["descriptors"]):
            raise InvalidLayout(f"{where}.seen: one number is needed for each descriptor.", f"{where}.seen")
        edges.append(EdgeStatistics(*_ends(edge, labels, where), edge["seen"]))
    return ModelStatistics(
        pages=read["pages"],
        descriptors=read["descriptors"],
        nodes=tuple(NodeStatistics(**node) for node in read["nodes"]),
        edges=tuple(edges),
        certainty=read["certainty"],
    )


def _ends(edge: _Ends, labels: list[str | None], where: str) -> tuple[str | None, str | None]:
    """The labels of both nodes of an edge, which its document has by their places."""
    for end, place in (("upper", edge["upper"]), ("lower", edge["lower"])):
        if place != int(place) or place >= len(labels):
            raise InvalidLayout(f"{where}.{end}: there is no node {place:g}.", f"{where}.{end}")
    return labels[int(edge["upper"])], labels[int(edge["lower"])]


def _invalid(error: ValidationError) -> InvalidLayout:
    """The first error, as a problem: it names the index of a node or an edge, not that of a number in a row."""
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    field = ""
    for step in first["loc"]:
        if isinstance(step, int) and not field.endswith(("nodes", "edges")):
            break
        field += f"[{step}]" if isinstance(step, int) else f".{step}"
    if first["loc"][-1] == "[key]":  # the name itself is wrong, and may be long
        field = field.removesuffix(".[key]").rpartition(".")[0]
    field = field.removeprefix(".")
    reason = first["msg"].removeprefix("Value error, ")
    return InvalidLayout(f"{field}: {reason}.", field)
