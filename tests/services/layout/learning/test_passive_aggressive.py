"""Learning by a margin: steps are of the least length, bounded, and the margin is kept once it is reached."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings

from services.layout.learning.passive_aggressive import MarginParameters, learn_by_margin, less_margin
from services.layout.learning.slopes import SlopeRates, cost_slopes, step_along
from services.layout.matching import match_directly
from services.layout.model.cost import build_cost_tables, labelling_cost
from services.layout.model.statistics import label_indices
from tests.services.layout.learning.learning_models import (
    classes,
    known_lesson,
    learning_model,
    mislabelled,
    seeds,
)


def cost(graph, model, labels) -> float:
    return sum(labelling_cost(graph, model, labels, model.scales))


@settings(max_examples=25, deadline=None)
@given(classes, seeds)
def test_the_cost_is_linear_along_its_slopes(document_class: str, seed: int) -> None:
    """A step of size t lowers the cost by t times the squared length of the slopes."""
    learned = learning_model(document_class)
    page = known_lesson(learned, document_class, seed)
    labels = mislabelled(learned, page, seed, 0.3)
    slopes, rates = cost_slopes(page.graph, learned.model, labels), SlopeRates()
    size = 1e-4  # so that no weight reaches zero
    stepped = step_along(learned.model, slopes, rates, size)
    fallen = cost(page.graph, learned.model, labels) - cost(page.graph, stepped, labels)
    np.testing.assert_allclose(fallen, size * slopes.squared(rates), rtol=1e-6)


@settings(max_examples=25, deadline=None)
@given(classes, seeds)
def test_an_unbounded_step_gives_the_margin_to_what_broke_it(document_class: str, seed: int) -> None:
    learned = learning_model(document_class)
    page = known_lesson(learned, document_class, seed)
    truth = label_indices(page.labels, learned.labels)
    # Without weights, which end at zero, the cost is linear for any step.
    parameters = MarginParameters(aggressiveness=1e9, rates=SlopeRates(weights=0.0))
    tables = build_cost_tables(page.graph, learned.model)
    broke = match_directly(less_margin(tables, truth, parameters.margin), parameters.matching).labels
    model, changed = learn_by_margin(learned.model, page.graph, truth, parameters)
    if not changed:
        assert model is learned.model
        return
    gap = cost(page.graph, model, broke) - cost(page.graph, model, truth)
    np.testing.assert_allclose(gap, np.count_nonzero(broke != truth) * parameters.margin, rtol=1e-6)


@settings(max_examples=25, deadline=None)
@given(classes, seeds)
def test_a_bounded_step_is_no_longer_than_allowed(document_class: str, seed: int) -> None:
    learned = learning_model(document_class, 1)
    page = known_lesson(learned, document_class, seed)
    truth = label_indices(page.labels, learned.labels)
    parameters = MarginParameters(aggressiveness=0.01)
    model, changed = learn_by_margin(learned.model, page.graph, truth, parameters)
    moved = np.abs(model.label_costs - learned.model.label_costs).max()
    assert moved <= 0.01 * learned.model.scales.max() * len(truth)
    assert changed or moved == 0
    assert (model.weights >= 0).all()


def test_a_page_with_its_margin_teaches_nothing_more() -> None:
    learned = learning_model("memo")
    page = known_lesson(learned, "memo", 1)
    truth = label_indices(page.labels, learned.labels)
    model = learned.model
    for _ in range(100):
        model, changed = learn_by_margin(model, page.graph, truth)
        if not changed:
            break
    assert not changed
    found = match_directly(build_cost_tables(page.graph, model), MarginParameters().matching).labels
    np.testing.assert_array_equal(found, truth)


def test_the_margin_is_taken_from_every_label_but_the_true_one() -> None:
    learned = learning_model("memo")
    page = known_lesson(learned, "memo", 1)
    truth = label_indices(page.labels, learned.labels)
    tables = build_cost_tables(page.graph, replace(learned.model))
    eased = less_margin(tables, truth, 1.5)
    rows = np.arange(len(truth))
    np.testing.assert_allclose(eased.node[rows, truth], tables.node[rows, truth])
    assert np.count_nonzero(np.isclose(tables.node - eased.node, 1.5)) == tables.node.size - len(truth)
