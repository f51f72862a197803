"""Models as arrays: what a model does not know costs nothing, what only it knows is left out."""

from dataclasses import replace

import numpy as np

from services.layout.graph.amount_features import AMOUNT_FEATURES
from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import DERIVED_FEATURES, RELATION_OFFSETS
from services.layout.graph.node_attributes import APPEARANCE_ATTRIBUTES, NUMERIC_ATTRIBUTES
from services.layout.graph.section_features import SECTION_FEATURES
from services.layout.graph.zone_words import WORD_ASPECTS
from services.layout.model.compiled_model import (
    SUREST,
    comparable_scales,
    compile_model,
    content_scale_name,
    default_scales,
    scale_names,
)
from services.layout.model.layout_model import (
    Calibration,
    LayoutModel,
    ModelEdge,
    ModelNode,
    NumericExpectation,
)

NODES = (
    ModelNode(None, 0.0, 2.0, {}, {}, (0.0, 1.0)),
    ModelNode(
        "date",
        3.0,
        0.5,
        {"left": NumericExpectation(0.3, 0.01), "smell": NumericExpectation(9.0, 9.0)},
        {"date": 1.0, "name": 0.0, "ghost": 0.5},
        (2.0, 0.1, 4.0),
    ),
)
EDGE = ModelEdge("date", None, {"left-left": (1.0, 2.0, 3.0), "top-top": (1.0, 2.0), "taste": (5.0,)})
MODEL = LayoutModel("m", 1, NODES, (EDGE,), {"left": 0.7, "ghosts": 3.0}, Calibration(-5.0, 1.0, 0))
NAMES = ("date", "name", "zipcode")


def test_attributes_go_by_name() -> None:
    compiled = compile_model(MODEL, NAMES)
    left = [attribute.name for attribute in NUMERIC_ATTRIBUTES].index("left")
    assert compiled.values[1, left] == 0.3
    assert compiled.variances[1, left] == 0.01
    assert np.isfinite(compiled.values).sum() == 1
    np.testing.assert_array_equal(compiled.content[1], [1 - SUREST, SUREST, np.nan])
    assert np.isnan(compiled.content[0]).all()
    assert compiled.label_costs.tolist() == [2.0, 0.5]


def test_tables_of_another_length_are_no_tables_of_ours() -> None:
    relations = compile_model(MODEL, NAMES).relations
    told = {
        relation.name: relations[1, 0, RELATION_OFFSETS[k] : RELATION_OFFSETS[k + 1]].tolist()
        for k, relation in enumerate(RELATIONS)
    }
    assert told.pop("left-left") == [1.0, 2.0, 3.0]
    assert not any(any(costs) for costs in told.values())
    relations[1, 0] = 0.0
    assert not relations.any(), "edges that are not listed cost nothing"


def test_the_last_count_is_that_of_more_too() -> None:
    assert compile_model(MODEL, NAMES).counts.tolist() == [[0.0, 1.0, 1.0], [2.0, 0.1, 4.0]]


def test_scales_are_the_usual_ones_where_none_is_told() -> None:
    scales = compile_model(MODEL, NAMES).scales
    names, usual = scale_names(NAMES), default_scales(NAMES)
    assert len(names) == len(usual) == len(scales) == len(set(names))
    assert scales[names.index("left")] == 0.7
    others = [k for k, name in enumerate(names) if name != "left"]
    np.testing.assert_array_equal(scales[others], usual[others])
    assert (usual > 0).all()


def test_a_model_without_content_works_without_features() -> None:
    compiled = compile_model(replace(MODEL, edges=()), ())
    assert compiled.content.shape == (2, 0)
    assert not compiled.relations.any()


def test_classes_are_compared_without_sections_amounts_appearance_and_words() -> None:
    known = ("date", *DERIVED_FEATURES)
    usual, compared = default_scales(known), comparable_scales(known)
    differ = {
        name for name, one, other in zip(scale_names(known), usual, compared, strict=True) if one != other
    }
    derived = map(content_scale_name, (*SECTION_FEATURES, *AMOUNT_FEATURES))
    assert differ == {*derived, *APPEARANCE_ATTRIBUTES, *WORD_ASPECTS}
