"""Costs of matches: their parts sum up, Equation 5.3's signs hold, and what is unknown costs nothing."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import LayoutGraph, build_graph
from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES
from services.layout.model.compiled_model import CompiledModel, compile_model, default_scales
from services.layout.model.cost import (
    MOST_EXPLAINED,
    USUAL_CONTENT,
    build_cost_tables,
    content_cost,
    explain_cost,
    labelling_cost,
    node_terms,
    relation_weight,
)
from services.layout.pipeline import content_features
from tests.services.layout.samples import MAKERS, labelled_page, model_of, page_of

NAMES = content_features().names
COLUMNS = [attribute.name for attribute in NUMERIC_ATTRIBUTES]


def pair_of(name: str, seed: int, zones: int | None = None) -> tuple[LayoutGraph, CompiledModel, list[str]]:
    page = labelled_page(name, seed)
    page = replace(page, zones=page.zones[:zones])
    graph = build_graph(page, NAMES)
    return graph, compile_model(model_of(name, 3), graph.content_names), [zone.id for zone in page.zones]


@pytest.mark.parametrize("name", MAKERS)
def test_tables_hold_the_cost_of_every_labelling(name: str) -> None:
    graph, model, _ = pair_of(name, 1003)
    tables = build_cost_tables(graph, model)
    rng = np.random.default_rng(0)
    for _ in range(20):
        labels = rng.integers(0, len(model.labels), graph.zones)
        parts = labelling_cost(graph, model, labels, model.scales)
        assert tables.cost(labels) == pytest.approx(sum(parts), rel=1e-9)
    assert (tables.pairs[:, 0] < tables.pairs[:, 1]).all()
    assert tables.count.shape == (len(model.labels), graph.zones + 1)


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(sorted(MAKERS)), st.integers(0, 2**32 - 1))
def test_the_terms_that_are_told_sum_up_to_the_cost(name: str, seed: int) -> None:
    graph, model, ids = pair_of(name, 1004, zones=6)
    labels = np.random.default_rng(seed).integers(0, len(model.labels), graph.zones)
    terms = explain_cost(graph, model, labels, ids)
    node, edge, count = labelling_cost(graph, model, labels, model.scales)
    assert len(terms) < MOST_EXPLAINED
    assert sum(term.cost for term in terms if term.other is None) == pytest.approx(node, abs=1e-9)
    assert sum(term.cost for term in terms if term.other is not None) == pytest.approx(edge, abs=1e-9)
    whole = build_cost_tables(graph, model).cost(labels)
    assert sum(term.cost for term in terms) + count == pytest.approx(whole, abs=1e-9)
    sizes = [abs(term.cost) for term in terms]
    assert sizes == sorted(sizes, reverse=True)
    assert min(sizes) > 0
    assert {term.zone for term in terms} | {term.other for term in terms} <= {*ids, None}


def test_of_many_terms_the_largest_are_told() -> None:
    graph, model, ids = pair_of("two-column", 1000)
    terms = explain_cost(graph, model, np.zeros(graph.zones, np.intp) + 1, ids)
    assert len(terms) == MOST_EXPLAINED
    sizes = [abs(term.cost) for term in terms]
    assert sizes == sorted(sizes, reverse=True)
    whole = labelling_cost(graph, model, np.zeros(graph.zones, np.intp) + 1, np.abs(model.scales))
    total = graph.zones * (graph.numeric.shape[1] + 1) + graph.relations.size
    untold = abs(sum(whole[:2]) - sum(term.cost for term in terms))
    assert untold <= total * sizes[-1], "none that is untold is larger"


def test_other_weights_give_other_costs_of_the_same_terms() -> None:
    graph, model, _ = pair_of("memo", 1001)
    labels = np.arange(graph.zones) % len(model.labels)
    usual = default_scales(graph.content_names)
    once = labelling_cost(graph, model, labels, usual)
    twice = labelling_cost(graph, model, labels, 2 * usual)
    assert twice == pytest.approx([2 * part for part in once])
    assert labelling_cost(graph, model, labels, np.zeros_like(usual)) == (0.0, 0.0, 0.0)


def test_a_term_is_relative_to_a_zone_of_any_page() -> None:
    """Student's t of the model against that of the background, by hand."""
    graph, model, _ = pair_of("letter", 1002)
    column = COLUMNS.index("width")
    mean, deviation = NUMERIC_ATTRIBUTES[column].background
    for zone, label in ((0, 1), (3, 2), (5, 4)):
        value, expected, variance = (
            graph.numeric[zone, column],
            model.values[label, column],
            model.variances[label, column],
        )
        own = 2.5 * np.log(1 + (value - expected) ** 2 / (4 * variance)) + 0.5 * np.log(variance)
        any_page = 2.5 * np.log(1 + (value - mean) ** 2 / (4 * deviation**2)) + np.log(deviation)
        assert node_terms(graph, model)[zone, label, column] == pytest.approx(own - any_page)


def test_each_attribute_is_cheapest_at_what_is_expected() -> None:
    graph, model, _ = pair_of("memo", 1001)
    label = 2
    known = np.isfinite(model.values[label])
    # The pages have no image, so eight attributes of appearance are unknown; one other may be.
    assert known.sum() >= len(COLUMNS) - 9
    for column, attribute in enumerate(NUMERIC_ATTRIBUTES):
        if not known[column]:
            continue
        steps = np.linspace(-3, 3, 13) * attribute.spread
        values = np.repeat(graph.numeric[:1], len(steps), axis=0)
        values[:, column] = model.values[label, column] + steps
        line = replace(graph, numeric=values, content=np.repeat(graph.content[:1], len(steps), axis=0))
        background = attribute.cost(
            values[:, column], np.array(attribute.background[0]), np.array(attribute.background[1] ** 2)
        )
        costs = node_terms(line, model)[:, label, column] + background
        assert costs.argmin() == len(steps) // 2, attribute.name


def test_what_is_unknown_costs_nothing() -> None:
    bare = build_graph(page_of((100, 100, 300, 200), (100, 300, 800, 900)), NAMES)
    model = compile_model(model_of("letter", 3), bare.content_names)
    terms = node_terms(bare, model)
    assert np.isfinite(terms).all()
    unknown = np.isnan(bare.numeric).all(axis=0)
    assert unknown.sum() == 15
    assert not terms[:, :, : len(COLUMNS)][:, :, unknown].any()
    assert not terms[:, :, len(COLUMNS) : len(COLUMNS) + len(NAMES)].any(), "the page was not read"


@settings(deadline=None)
@given(st.floats(0.003, 0.997), st.floats(0, 1), st.floats(0, 1))
def test_content_costs_have_the_signs_of_equation_5_3(expectation: float, low: float, high: float) -> None:
    low, high = sorted((low, high))
    e = np.array(expectation)
    less, more, half = (float(content_cost(np.array(p), e)) for p in (low, high, low + (high - low) / 2))
    assert half == pytest.approx((less + more) / 2, abs=1e-9), "linear in the confidence"
    if abs(expectation - USUAL_CONTENT) > 1e-6 and high - low > 1e-6:
        assert (more < less) == (expectation > USUAL_CONTENT)
    never, always = float(content_cost(np.array(0.0), e)), float(content_cost(np.array(1.0), e))
    assert never * always <= 1e-12, "one speaks for, the other against"


def test_content_costs_by_hand() -> None:
    usual = np.array(USUAL_CONTENT)
    assert float(content_cost(np.array(0.7), usual)) == pytest.approx(0.0)
    assert float(content_cost(np.array(1.0), np.array(0.9))) == pytest.approx(-np.log(9))
    assert float(content_cost(np.array(0.0), np.array(0.9))) == pytest.approx(np.log(9))


def test_relations_of_crowded_pages_weigh_less_each() -> None:
    weights = [relation_weight(zones) for zones in (0, 1, 2, 5, 26)]
    assert weights == pytest.approx([1.0, 1.0, 1.0, 0.5, 0.2])


def test_relations_cost_what_their_tables_say() -> None:
    graph, model, _ = pair_of("fax", 1000, zones=2)
    ((upper, lower),) = graph.pairs
    only = np.zeros_like(model.scales)
    only[-1 - len(RELATIONS) :][:-1] = 1.0
    for a, b in ((1, 2), (2, 1), (3, 3)):
        labels = np.zeros(2, np.intp)
        labels[upper], labels[lower] = a, b
        start = np.concatenate([[0], np.cumsum([len(relation.descriptors) for relation in RELATIONS])])[:-1]
        expected = model.relations[a, b, start + graph.relations[0]].sum()
        assert labelling_cost(graph, model, labels, only)[1] == pytest.approx(expected)
