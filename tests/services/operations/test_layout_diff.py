"""What is told of two versions of a model: which numbers changed, and which of them matter most."""

import json
from dataclasses import replace

import pytest

from services.contract.layout import ModelDocument
from services.errors import InvalidModel
from services.layout.model.layout_model import (
    Calibration,
    LayoutModel,
    ModelEdge,
    ModelNode,
    NumericExpectation,
)
from services.layout.model.model_document import model_to_document
from services.operations.layout_diff import compare_models

NULL = ModelNode(None, 10.0, 0.5, {"left": NumericExpectation(0.5, 0.1)}, {"date": 0.1}, (0.0, 0.1))
DATE = ModelNode("date", 4.0, 1.0, {"left": NumericExpectation(0.7, 0.04)}, {"date": 0.9}, (2.0, 0.0, 3.0))
BODY = ModelNode("body", 9.0, 0.2, {"left": NumericExpectation(0.1, 0.01)}, {"date": 0.0}, (4.0, 0.0))
MODEL = LayoutModel(
    "letter",
    3,
    (NULL, DATE, BODY),
    (ModelEdge("date", "body", {"top-top": (3.0, 2.0, 0.0), "later": (1.0,)}),),
    {"left": 0.5, "content:date": 2.0, "label": 0.4, "count": 0.4, "top-top": 0.15},
    Calibration(-1.0, 0.5, 3),
)


def stored(model: LayoutModel, version: int) -> ModelDocument:
    return ModelDocument(model.name, version, json.dumps(model_to_document(model)).encode())


def changes(new: LayoutModel, old: LayoutModel = MODEL, most: int = 100) -> list[tuple[object, ...]]:
    difference = compare_models(stored(old, 1), stored(new, 2), most)
    assert len(difference.changes) == min(difference.total, most)
    return [tuple(change.model_dump().values()) for change in difference.changes]


def test_a_version_differs_from_itself_in_nothing() -> None:
    assert changes(MODEL) == []


def test_every_number_that_changed_is_told_and_the_one_that_moves_costs_most_comes_first() -> None:
    date = replace(
        DATE,
        zones=5.0,
        cost=1.2,
        numeric={"left": NumericExpectation(0.9, 0.09)},
        content={"date": 0.95},
        count_costs=(2.0, 0.0, 5.0),
    )
    edge = ModelEdge("date", "body", {"top-top": (3.0, 4.0, 0.0), "later": (1.0,)})
    new = replace(
        MODEL,
        samples=4,
        nodes=(NULL, date, BODY),
        edges=(edge,),
        scales={**MODEL.scales, "left": 0.6},
        calibration=Calibration(-1.05, 0.5, 4),
    )
    assert changes(new) == [
        ("node", ["date"], "content:date", 0.9, 0.95),  # 2 (ln 19 - ln 9) = 1.49
        ("node", ["date"], "count:2", 3.0, 5.0),  # 0.4 * 2
        ("node", ["date"], "left:value", 0.7, 0.9),  # 0.5 * 0.2 / 0.2
        ("edge", ["date", "body"], "top-top:aligned", 2.0, 4.0),  # 0.15 * 2
        ("node", ["date"], "left:variance", 0.04, 0.09),  # 0.5 * ln(1.5) = 0.2
        ("model", [], "calibration:mean", -1.0, -1.05),
        ("model", [], "weight:left", 0.5, 0.6),
        ("node", ["date"], "cost", 1.0, 1.2),
        ("model", [], "samples", 3, 4),
        ("model", [], "calibration:pages", 3, 4),
        ("node", ["date"], "zones", 4.0, 5.0),
    ]
    assert changes(new, most=2) == changes(new)[:2]


def test_a_node_that_came_is_one_change_and_comes_first() -> None:
    new = replace(
        MODEL,
        nodes=(*MODEL.nodes, replace(DATE, label="place")),
        edges=(*MODEL.edges, ModelEdge("place", None, {"top-top": (9.0, 0.0, 0.0)})),
        calibration=Calibration(9.0, 0.5, 3),
    )
    came = changes(new)
    assert came == [
        ("node", ["place"], "zones", None, 4.0),
        ("model", [], "calibration:mean", -1.0, 9.0),
    ]
    went = changes(MODEL, new)
    assert went[0] == ("node", ["place"], "zones", 4.0, None)


def test_what_is_not_listed_has_no_cost_and_no_expectation() -> None:
    nodes = (NULL, replace(DATE, numeric={}, content={}), BODY)
    assert changes(replace(MODEL, nodes=nodes, edges=())) == [
        ("node", ["date"], "content:date", 0.9, None),
        ("edge", ["date", "body"], "later:0", 1.0, 0.0),
        ("node", ["date"], "left:value", 0.7, None),
        ("edge", ["date", "body"], "top-top:above", 3.0, 0.0),
        ("edge", ["date", "body"], "top-top:aligned", 2.0, 0.0),
        ("node", ["date"], "left:variance", 0.04, None),
    ]


def test_labels_tell_null_from_nothing() -> None:
    null = replace(NULL, cost=0.75)
    assert changes(replace(MODEL, nodes=(null, DATE, BODY))) == [("node", [None], "cost", 0.5, 0.75)]


def test_a_version_of_another_release_cannot_be_compared() -> None:
    with pytest.raises(InvalidModel, match="Version 1 of model letter"):
        compare_models(ModelDocument("letter", 1, b'{"format": "older"}'), stored(MODEL, 2), 10)
