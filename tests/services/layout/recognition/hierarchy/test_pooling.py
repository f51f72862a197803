"""A genre's model says what its members say together."""

from dataclasses import fields, replace

import numpy as np
import pytest

from services.layout.model.compiled_model import CompiledModel
from services.layout.model.layout_model import MOST_LABELS, LayoutModel, ModelNode, NumericExpectation
from services.layout.recognition.hierarchy.pooling import pool_models
from tests.services.layout.recognition.hierarchy.bases import base, compiled
from tests.services.layout.samples import MAKERS, model_of


def pooled(*models: LayoutModel) -> CompiledModel:
    return pool_models(models, [compiled(model) for model in models])


def arrays(model: CompiledModel) -> dict[str, np.ndarray]:
    return {
        each.name: getattr(model, each.name) for each in fields(model) if each.name not in ("labels", "words")
    }


def node(label: str | None, zones: float, value: float, variance: float) -> ModelNode:
    numeric = {"top": NumericExpectation(value, variance)}
    return ModelNode(label, zones, 1.0, numeric, {"date": 0.5}, (1.0, 0.5))


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("times", [1, 3])
def test_of_one_model_and_of_equal_ones_it_is_that_model(name: str, times: int) -> None:
    model = model_of(name, 3)
    genre, one = pooled(*[model] * times), compiled(model)
    assert genre.labels == one.labels
    for part, values in arrays(genre).items():
        np.testing.assert_allclose(values, arrays(one)[part], rtol=1e-6, atol=1e-9, err_msg=part)


def test_nodes_are_mixtures_by_zones_a_page() -> None:
    one = replace(
        model_of("memo", 1), samples=1, edges=(), nodes=(node(None, 1, 0.5, 0.1), node("a", 0.95, 0.2, 0.04))
    )
    other = replace(one, samples=10, nodes=(node(None, 10, 0.5, 0.1), node("a", 29.5, 0.6, 0.01)))
    genre = pooled(one, other)
    column = 3  # of "top"
    assert genre.labels == (None, "a")
    mean = (1 * 0.2 + 3 * 0.6) / 4
    assert genre.values[1, column] == pytest.approx(mean)
    spread = (1 * (0.04 + (0.2 - mean) ** 2) + 3 * (0.01 + (0.6 - mean) ** 2)) / 4
    assert genre.variances[1, column] == pytest.approx(spread)
    assert np.isnan(genre.values[1, 0])


def test_a_label_that_a_model_lacks_is_absent_from_its_pages() -> None:
    one = replace(model_of("memo", 1), edges=(), nodes=(node(None, 1, 0.5, 0.1), node("a", 1, 0.2, 0.1)))
    other = replace(one, nodes=(node(None, 1, 0.5, 0.1), node("b", 1, 0.7, 0.1)))
    genre = pooled(one, other)
    assert genre.labels == (None, "a", "b")
    np.testing.assert_allclose(genre.values[1:, 3], [0.2, 0.7])
    expected = -np.log([(np.exp(-1.0) + 1) / 2, np.exp(-0.5) / 2])
    np.testing.assert_allclose(genre.counts[1:], [expected] * 2)
    np.testing.assert_allclose(genre.label_costs, [1.0, 1.0 + np.log(2), 1.0 + np.log(2)])


def test_the_order_of_models_does_not_matter() -> None:
    models = [each.model for each in base(2)]
    genre, other = pooled(*models), pooled(*models[::-1])
    assert genre.labels == other.labels
    for part, values in arrays(genre).items():
        np.testing.assert_allclose(values, arrays(other)[part], rtol=1e-9, atol=1e-9, err_msg=part)


def test_the_most_frequent_labels_are_kept() -> None:
    first = replace(
        model_of("memo", 1),
        samples=1,
        edges=(),
        nodes=(node(None, 1, 0.5, 0.1), *(node(f"l{k:03}", 2 + k, 0.5, 0.1) for k in range(MOST_LABELS - 1))),
    )
    second = replace(
        first, nodes=(node(None, 1, 0.5, 0.1), *(node(f"m{k:03}", 1, 0.5, 0.1) for k in range(MOST_LABELS)))
    )
    labels = pooled(first, second).labels
    assert labels == (None, *(f"l{k:03}" for k in range(MOST_LABELS - 1)), "m000")


def test_costs_of_any_size_are_pooled() -> None:
    model = model_of("fax", 1)
    nodes = tuple(
        replace(each, cost=sign * 1e9, count_costs=(sign * -1e9, sign * 1e9), zones=0.0)
        for each, sign in zip(model.nodes, [1, -1] * 40, strict=False)
    )
    genre = pooled(model, replace(model, nodes=nodes, samples=0))
    for part, values in arrays(genre).items():
        assert np.isfinite(values[~np.isnan(values)]).all(), part
    assert not np.isnan(genre.relations).any()
    assert not np.isnan(genre.counts).any()
