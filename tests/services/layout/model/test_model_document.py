"""Model documents: read back as written, and whatever is damaged in them is named."""

import copy
import json
import math
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.contract.layout import LONGEST_LABEL
from services.layout.model.layout_model import (
    LARGEST,
    MODEL_FORMAT_VERSION,
    MOST_LABELS,
    Calibration,
    EdgeStatistics,
    LayoutModel,
    ModelEdge,
    ModelNode,
    ModelStatistics,
    NodeStatistics,
    NumericExpectation,
    PieceStatistics,
)
from services.layout.model.model_document import (
    LONGEST_NAME,
    MOST_DESCRIPTORS,
    MOST_NAMES,
    model_from_document,
    model_to_document,
)
from services.layout.page import InvalidLayout
from services.layout.tables.table_model import ColumnModel, ProductRule, TableModel

MODEL = LayoutModel(
    name="letter",
    samples=2,
    nodes=(
        ModelNode(None, 0.0, 2.5, {}, {}, (0.1, 2.0)),
        ModelNode(
            "date",
            2.0,
            0.7,
            {"left": NumericExpectation(0.4, 0.01, 1.25)},
            {"date": 0.9},
            (3.0, 0.1, 4.0),
            {"date": 0.5},
            PieceStatistics(0.5, 1.5, 2.0, 1.0, (3.0, -4.5, 7.0), (3.0, -9.0, 28.0)),
        ),
    ),
    edges=(
        ModelEdge("date", "date", {"left-left": (1.0, -0.5, 1.0)}),
        ModelEdge(None, "date", {}),
    ),
    scales={"left": 0.15, "label": 0.4},
    calibration=Calibration(-6.5, 0.8, 2, 0.25),
    statistics=ModelStatistics(
        pages=2.0,
        descriptors=("left-left:to-the-left", "left-left:aligned", "left-left:to-the-right"),
        nodes=(
            NodeStatistics(0.0, {}, {}, (2.0,)),
            NodeStatistics(2.0, {"left": (2.0, 0.8, 0.34)}, {"date": (2.0, 1.9)}, (0.0, 2.0)),
        ),
        edges=(EdgeStatistics("date", "date", (1.0, 0.0, 1.0)),),
        certainty={"left": 3.5},
    ),
    table=TableModel(
        (
            ColumnModel(
                "price",
                2.0,
                3.0,
                4.0,
                {"preis": 2.0},
                {"amount": 3.0},
                (2.0, 1.0, 0.5),
                (2.0, 1.5, 1.1),
                (3.0, -1.0, 9.0),
            ),
        ),
        *(2.0, 1.0, 0.0),
        (ProductRule("price", "quantity", "amount", 3.0, 3.0),),
    ),
)
Path = tuple[str | int, ...]


def document() -> dict[str, Any]:
    """A fresh one, as it comes over the wire."""
    return json.loads(json.dumps(model_to_document(MODEL)))


def fields_of(model: LayoutModel) -> tuple[object, ...]:
    return (
        *(model.name, model.samples, model.nodes, model.edges),
        *(model.scales, model.calibration, model.statistics, model.table),
    )


def changed(path: Path, value: Any) -> dict[str, Any]:
    """The document with the value at `path` replaced."""
    damaged = document()
    holder: Any = damaged
    for step in path[:-1]:
        holder = holder[step]
    holder[path[-1]] = value
    return damaged


names = st.text(st.characters(categories=["L", "N", "P", "S"]), min_size=1, max_size=LONGEST_NAME)
numbers = st.floats(-LARGEST, LARGEST)
expectations = st.builds(NumericExpectation, numbers, st.floats(1e-9, LARGEST))


@st.composite
def models(draw: st.DrawFn) -> LayoutModel:
    labels = (None, *draw(st.lists(names.map(lambda name: name[:LONGEST_LABEL]), max_size=4, unique=True)))
    nodes = tuple(
        ModelNode(
            label,
            draw(st.floats(0, 1e6)),
            draw(numbers),
            draw(st.dictionaries(names, expectations, max_size=3)),
            draw(st.dictionaries(names, st.floats(0, 1), max_size=3)),
            tuple(draw(st.lists(numbers, min_size=2, max_size=5))),
        )
        for label in labels
    )
    ends = st.tuples(st.sampled_from(labels), st.sampled_from(labels))
    tables = st.dictionaries(names, st.lists(numbers, max_size=4).map(tuple), max_size=2)
    edges = tuple(ModelEdge(*pair, draw(tables)) for pair in draw(st.lists(ends, max_size=4, unique=True)))
    return LayoutModel(
        draw(names),
        draw(st.integers(0, 10**6)),
        nodes,
        edges,
        draw(st.dictionaries(names, st.floats(0, 1e3), max_size=3)),
        Calibration(draw(numbers), draw(st.floats(1e-6, LARGEST)), draw(st.integers(0, 10**6))),
    )


@pytest.mark.pipeline
@settings(max_examples=60)
@given(models())
def test_models_are_read_as_they_were_written(model: LayoutModel) -> None:
    read = model_from_document(json.loads(json.dumps(model_to_document(model), allow_nan=False)))
    assert fields_of(read) == fields_of(model)


def test_the_form_is_told() -> None:
    told = document()
    assert (told["format"], told["format_version"]) == ("layout-graph-model", MODEL_FORMAT_VERSION)
    assert told["edges"][0] == {"upper": 1, "lower": 1, "costs": {"left-left": [1.0, -0.5, 1.0]}}
    assert told["nodes"][0]["label"] is None


def test_edges_may_be_missing_and_other_keys_are_passed_over() -> None:
    assert model_from_document(changed(("edges",), [])).edges == ()
    later = document() | {"colour": "red"}
    later["nodes"][1]["smell"] = {"sweet": 1}
    assert fields_of(model_from_document(later)) == fields_of(MODEL)


def test_tables_of_any_length_are_read() -> None:
    """What attributes there are is not known here; a later service may have more descriptors."""
    read = model_from_document(changed(("edges", 0, "costs", "left-left"), [1.0] * 7))
    assert read.edges[0].costs["left-left"] == (1.0,) * 7


def test_whole_numbers_may_be_told_as_floats() -> None:
    read = model_from_document(changed(("samples",), 2.0))
    assert read.samples == 2
    assert isinstance(read.samples, int)


NODE: Path = ("nodes", 1)
EDGE: Path = ("edges", 0)
DAMAGES: list[tuple[Path, Any, str]] = [
    (("format",), "layout-graph", "format"),
    (("format",), None, "format"),
    (("format_version",), MODEL_FORMAT_VERSION + 1, "format_version"),
    (("format_version",), 0, "format_version"),
    (("format_version",), True, "format_version"),
    (("format_version",), "1", "format_version"),
    (("format_version",), [[1]] * 1000, "format_version"),
    (("name",), "", "name"),
    (("name",), "a\nb", "name"),
    (("name",), "n" * (LONGEST_NAME + 1), "name"),
    (("name",), 7, "name"),
    (("samples",), -1, "samples"),
    (("samples",), 1.5, "samples"),
    (("samples",), True, "samples"),
    (("nodes",), [], "nodes"),
    (("nodes",), {}, "nodes"),
    (("nodes",), [None] * (MOST_LABELS + 2), "nodes"),
    (("nodes", 0, "label"), "first", "nodes"),
    ((*NODE, "label"), None, "nodes"),
    ((*NODE, "label"), 5, "nodes[1].label"),
    ((*NODE, "label"), "x" * 61, "nodes[1].label"),  # no zone of a sample may have these
    ((*NODE, "label"), " body", "nodes[1].label"),
    (NODE, "node", "nodes[1]"),
    ((*NODE, "zones"), -1, "nodes[1].zones"),
    ((*NODE, "cost"), math.nan, "nodes[1].cost"),
    ((*NODE, "cost"), 10**400, "nodes[1].cost"),
    ((*NODE, "numeric"), [], "nodes[1].numeric"),
    ((*NODE, "numeric", "left"), 0.4, "nodes[1].numeric.left"),
    ((*NODE, "numeric", "left", "value"), math.inf, "nodes[1].numeric.left.value"),
    ((*NODE, "numeric", "left", "variance"), 0.0, "nodes[1].numeric.left.variance"),
    ((*NODE, "numeric", "left", "variance"), -1.0, "nodes[1].numeric.left.variance"),
    ((*NODE, "content", "date"), 1.01, "nodes[1].content.date"),
    ((*NODE, "content", "date"), False, "nodes[1].content.date"),
    ((*NODE, "content"), {str(k): 0.5 for k in range(MOST_NAMES + 1)}, "nodes[1].content"),
    ((*NODE, "count_costs"), [1.0], "nodes[1].count_costs"),
    ((*NODE, "count_costs"), [0.0, "1"], "nodes[1].count_costs"),
    ((*NODE, "count_costs"), [0.0] * (MOST_DESCRIPTORS + 1), "nodes[1].count_costs"),
    (("edges",), None, "edges"),
    (EDGE, [1, 1], "edges[0]"),
    ((*EDGE, "upper"), 2, "edges[0].upper"),
    ((*EDGE, "lower"), -1, "edges[0].lower"),
    ((*EDGE, "lower"), "date", "edges[0].lower"),
    ((*EDGE, "lower"), True, "edges[0].lower"),
    (("edges", 1, "upper"), 1, "edges"),
    ((*EDGE, "costs"), None, "edges[0].costs"),
    ((*EDGE, "costs", "left-left"), {"0": 1}, "edges[0].costs.left-left"),
    ((*EDGE, "costs", "left-left"), [1.0, None], "edges[0].costs.left-left"),
    ((*EDGE, "costs", "left-left"), [2 * LARGEST], "edges[0].costs.left-left"),
    (("scales",), [], "scales"),
    (("scales", "left"), -0.1, "scales.left"),
    (("scales", "left"), 1e4, "scales.left"),
    (("calibration",), None, "calibration"),
    (("calibration", "mean"), "low", "calibration.mean"),
    (("calibration", "deviation"), 0.0, "calibration.deviation"),
    (("calibration", "pages"), -1, "calibration.pages"),
    (("calibration", "bias"), 1e9, "calibration.bias"),
    (("calibration", "evidence_slope"), 1e9, "calibration.evidence_slope"),
    ((*NODE, "numeric", "left", "weight"), -0.1, "nodes[1].numeric.left.weight"),
    ((*NODE, "joining"), 1e9, "nodes[1].joining"),
    ((*NODE, "pieces", "joining"), 1e9, "nodes[1].pieces.joining"),
    ((*NODE, "pieces", "whole"), -1, "nodes[1].pieces.whole"),
    ((*NODE, "pieces", "widths"), [1, 2], "nodes[1].pieces.widths"),
    ((*NODE, "content_weights", "date"), "much", "nodes[1].content_weights.date"),
    (("memory",), [], "memory"),
    (("memory", "pages"), -1, "memory.pages"),
    (("memory", "nodes"), [], "memory.nodes"),
    (("memory", "nodes", 1, "numeric", "left"), [1, 2], "memory.nodes[1].numeric.left"),
    (("memory", "nodes", 1, "numeric", "left"), [2, 0.5, -1], "memory.nodes[1].numeric.left"),
    (("memory", "nodes", 1, "content", "date"), [1, 2], "memory.nodes[1].content.date"),
    (("memory", "edges", 0, "upper"), 2, "memory.edges[0].upper"),
    (("memory", "edges", 0, "seen"), [-1, 0, 0], "memory.edges[0].seen"),
    (("memory", "edges", 0, "seen"), [1, 0], "memory.edges[0].seen"),
    (("memory", "descriptors"), ["", "a", "b"], "memory.descriptors"),
    (("memory", "certainty", "left"), -1, "memory.certainty.left"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "field"), DAMAGES)
def test_damage_is_named(path: Path, value: Any, field: str) -> None:
    with pytest.raises(InvalidLayout) as caught:
        model_from_document(changed(path, value))
    assert caught.value.field == field
    assert len(caught.value.detail) < 400


def paths(value: Any, here: Path = ()) -> Iterator[Path]:
    if here:
        yield here
    if isinstance(value, dict | list):
        steps = value.items() if isinstance(value, dict) else enumerate(value)
        for step, inner in steps:
            yield from paths(inner, (*here, step))


def test_models_of_earlier_releases_keep_their_log_odds_of_pieces() -> None:
    earlier = document()
    del earlier["nodes"][1]["pieces"]
    earlier["nodes"][1]["joining"] = 1.25
    assert model_from_document(earlier).nodes[1].pieces == PieceStatistics(1.25)


def test_a_version_of_more_digits_than_are_told_is_refused() -> None:
    with pytest.raises(InvalidLayout, match="format_version"):
        model_from_document(changed(("format_version",), 10**5000))


PATHS = sorted(paths(document()), key=str)


LEARNED = (
    "weight",
    "content_weights",
    "bias",
    "pieces",
    "merged",
    "apart",
    "within",
    "words",
    "memory",
    "evidence_slope",
    "evidence_intercept",
    "evidence_zones",
)
"""What models of earlier releases have not."""
NEEDED_OF_MEMORY = (
    *("pages", "nodes", "edges", "certainty"),
    *("zones", "numeric", "content", "counts", "upper", "lower", "descriptors", "seen"),
)


def optional(path: Path) -> bool:
    """Whether the rest is a model without what is at `path`."""
    return (
        (path[0] == "edges" and len(path) == 2)
        or path[:-1] in (("scales",), *((*NODE, each) for each in ("numeric", "content", "content_weights")))
        or "costs" in path[:-1]
        or path[:-1] == (*NODE, "count_costs")
        or path == ("nodes", 0, "label")  # which is null
        or path[-1] in LEARNED
        or path in (("table",), ("table", "products", 0))
        or path[-2:-1] in (("headers",), ("kinds",))
        or path[-2:-1] == ("tokens",)
        or path[:-1] == (*NODE, "words")
        or (path[0] == "memory" and not isinstance(path[-1], int) and path[-1] not in NEEDED_OF_MEMORY)
        or (path[0] == "memory" and path[-2] in ("counts", "edges"))
    )


@pytest.mark.parametrize("path", [path for path in PATHS if not optional(path)])
def test_nothing_else_may_be_missing(path: Path) -> None:
    damaged = document()
    holder: Any = damaged
    for step in path[:-1]:
        holder = holder[step]
    del holder[path[-1]]
    with pytest.raises(InvalidLayout) as caught:
        model_from_document(damaged)
    assert caught.value.field


@settings(max_examples=200)
@given(
    st.sampled_from(PATHS),
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(-(10**30), 10**30),
        st.floats(),
        st.text(max_size=5),
        st.lists(st.floats(), max_size=3),
        st.dictionaries(st.text(max_size=3), st.floats(), max_size=2),
        st.just([0.0] * 2000),
    ),
)
def test_any_value_anywhere_is_read_or_refused(path: Path, value: Any) -> None:
    damaged = changed(path, value)
    before = copy.deepcopy(damaged)
    field = None
    try:
        model = model_from_document(damaged)
        again = model_to_document(model)
        json.dumps(again, allow_nan=False)
        assert fields_of(model_from_document(again)) == fields_of(model)
    except InvalidLayout as error:
        field = error.field
    assert field is None or field.split("[")[0].split(".")[0] in (path[0], "nodes", "edges")
    assert repr(damaged) == repr(before), "what is read is left as it was"


@pytest.mark.parametrize("value", [None, [], "model", 3, True, {}, {"nodes": []}])
def test_what_is_no_model(value: Any) -> None:
    with pytest.raises(InvalidLayout):
        model_from_document(value)
