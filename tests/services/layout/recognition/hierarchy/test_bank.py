"""Unary scores of many models at once equal those of each model alone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.graph.layout_graph import LayoutGraph, build_graph
from services.layout.graph.zone_words import NO_TOKENS, WORD_ASPECTS
from services.layout.matching import MatchingParameters, match_directly
from services.layout.model.compiled_model import CompiledModel, comparable_scales, scale_names
from services.layout.model.cost import build_cost_tables, labelling_cost, node_terms
from services.layout.model.layout_model import LayoutModel
from services.layout.pipeline import content_features
from services.layout.recognition.hierarchy import bank as bank_module
from services.layout.recognition.hierarchy.bank import ModelBank, UnaryScores
from tests.services.layout.recognition.hierarchy.bases import NAMES, base, compiled, graph_of
from tests.services.layout.samples import MAKERS, model_of, page_of


def alone(graph: LayoutGraph, model: CompiledModel) -> tuple[float, float]:
    """Costs of one model by its own weights and by those that compare classes."""
    terms = node_terms(graph, model)
    scales = np.where(np.isin(scale_names(NAMES), WORD_ASPECTS), 0.0, model.scales)  # no part of the ranking
    labels = (terms @ scales[: terms.shape[2]]).argmin(axis=1)
    return (
        sum(labelling_cost(graph, model, labels, scales)),
        sum(labelling_cost(graph, model, labels, comparable_scales(NAMES))),
    )


def check(graph: LayoutGraph, models: list[CompiledModel]) -> UnaryScores:
    scores = ModelBank(models, NAMES).unary_scores(graph)
    expected = np.array([alone(graph, model) for model in models])
    np.testing.assert_allclose(scores.costs, expected[:, 0], rtol=1e-5, atol=1e-2)
    np.testing.assert_allclose(scores.comparable, expected[:, 1], rtol=1e-5, atol=1e-2)
    return scores


def bare(model: LayoutModel) -> LayoutModel:
    """Without half of its attributes, edges, and weights."""
    nodes = tuple(
        replace(
            node,
            numeric={name: each for name, each in node.numeric.items() if (len(name) + row) % 2},
            content={} if row % 2 else node.content,
            count_costs=node.count_costs[: 2 + row % 3],
        )
        for row, node in enumerate(model.nodes)
    )
    return replace(model, nodes=nodes, edges=model.edges[::2], scales={})


@pytest.mark.parametrize("name", MAKERS)
def test_each_model_has_the_costs_it_has_alone(name: str) -> None:
    check(graph_of(name, 1000), [compiled(each.model) for each in base(2)])


def test_models_and_pages_that_know_little() -> None:
    models = [compiled(bare(model_of(name, 3))) for name in MAKERS] + [compiled(model_of("fax", 1))]
    check(graph_of("letter", 1001), models)
    unread = page_of((100, 50, 300, 80), (100, 120, 800, 500), (600, 900, 700, 920))
    check(build_graph(unread, content_features().names), models)


@pytest.mark.parametrize("zones", [1, 2])
def test_pages_with_hardly_a_pair(zones: int) -> None:
    page = page_of(*[(100.0, 100.0 * k, 400.0, 100.0 * k + 40) for k in range(zones)])
    check(build_graph(page, content_features().names), [compiled(model_of("memo", 3))])


@pytest.mark.pipeline
def test_matching_costs_no_more_than_a_look() -> None:
    models = [compiled(each.model) for each in base(2)]
    for name in MAKERS:
        graph = replace(graph_of(name, 1002), tokens=NO_TOKENS)
        scores = check(graph, models)
        for cost, model in zip(scores.costs, models, strict=True):
            assert match_directly(build_cost_tables(graph, model), MatchingParameters()).cost <= cost + 0.01


def test_large_pages_are_seen_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    models, graph = [compiled(each.model) for each in base(1)], graph_of("two-column", 1003)
    whole = ModelBank(models, NAMES).unary_scores(graph)
    monkeypatch.setattr(bank_module, "MOST_ENTRIES", 1)
    parts = ModelBank(models, NAMES).unary_scores(graph)
    np.testing.assert_allclose(parts.costs, whole.costs, atol=1e-3)
    np.testing.assert_allclose(parts.comparable, whole.comparable, atol=1e-3)


@settings(max_examples=20, deadline=None)
@given(st.floats(-1e9, 1e9), st.floats(1e-9, 1e9), st.floats(-1e9, 1e9), st.floats(0, 1e3))
def test_any_model_that_may_be_imported_has_finite_costs(
    value: float, variance: float, cost: float, scale: float
) -> None:
    model = compiled(model_of("memo", 1))
    odd = replace(
        model,
        values=np.where(np.isnan(model.values), np.nan, value),
        variances=np.full_like(model.variances, variance),
        label_costs=np.full_like(model.label_costs, cost),
        relations=np.full_like(model.relations, cost),
        counts=np.full_like(model.counts, -cost),
        scales=np.full_like(model.scales, scale),
    )
    scores = ModelBank([model, odd], NAMES).unary_scores(graph_of("memo", 1004))
    assert np.isfinite(scores.costs).all()
    assert np.isfinite(scores.comparable).all()
    assert scores.comparable[0] == pytest.approx(alone(graph_of("memo", 1004), model)[1], rel=1e-5, abs=0.01)
