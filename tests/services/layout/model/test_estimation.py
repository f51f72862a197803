"""From sums to models: by hand with few samples, and near the truth with many."""

import numpy as np
import pytest

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import DERIVED_FEATURES, RELATION_OFFSETS, LayoutGraph
from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES
from services.layout.model.compiled_model import compile_model, default_scales
from services.layout.model.estimation import CONTENT_RANGE, estimate_model, name_parts
from services.layout.model.layout_model import Calibration
from services.layout.model.statistics import MOST_COUNTED, LabelledGraph, gather_statistics, total_statistics

NAMES = ("date", *DERIVED_FEATURES)
USUAL = np.array([attribute.spread**2 for attribute in NUMERIC_ATTRIBUTES])
DATE = 0


def graph_of(numeric: np.ndarray, content: np.ndarray, relations: np.ndarray | None = None) -> LayoutGraph:
    """A graph of zones with the given attributes; pairs of `relations` (E, R) are those of zones in a row."""
    told = np.zeros((0, len(RELATIONS)), np.intp) if relations is None else relations
    pairs = np.stack([np.arange(len(told)), np.arange(len(told)) + 1], axis=1)
    return LayoutGraph(numeric, content, NAMES, pairs, told)


def rows(*values: float) -> np.ndarray:
    """Zones whose attributes all have one value each."""
    return np.repeat(np.array(values)[:, None], len(NUMERIC_ATTRIBUTES), axis=1)


def content(*date: float) -> np.ndarray:
    return np.hstack([np.array(date)[:, None], np.zeros((len(date), len(DERIVED_FEATURES)))])


def estimated(graph: LayoutGraph, labels: tuple[str | None, ...], known: tuple[str | None, ...]):
    statistics = gather_statistics(LabelledGraph(graph, labels), known)
    return estimate_model(statistics, known, default_scales(NAMES))


def test_one_sample_is_what_is_expected_with_the_usual_spread() -> None:
    model = estimated(graph_of(rows(0.7), content(1.0)), ("date",), (None, "date"))
    np.testing.assert_allclose(model.values[1], 0.7)
    # (0 seen + 2 usual) / 3, and the mean of one is as uncertain as one value
    np.testing.assert_allclose(model.variances[1], USUAL * 4 / 3)
    assert np.isnan(model.values[0]).all(), "null was never seen"
    np.testing.assert_array_equal(model.variances[0], 1.0)
    assert np.isnan(model.content[0]).all()


def test_means_and_variances_of_two_by_hand() -> None:
    model = estimated(graph_of(rows(1.0, 3.0), content(0, 0)), ("a", "a"), (None, "a"))
    np.testing.assert_allclose(model.values[1], 2.0)
    np.testing.assert_allclose(model.variances[1], (2 * 1.0 + 2 * USUAL) / 4 * 1.5)


def test_attributes_are_estimated_from_the_zones_that_have_them() -> None:
    numeric = rows(1.0, 3.0)
    numeric[1, 4] = np.nan
    model = estimated(graph_of(numeric, content(0, 0)), ("a", "a"), (None, "a"))
    assert model.values[1, 4] == 1.0
    assert model.variances[1, 4] == pytest.approx(USUAL[4] * 4 / 3)
    assert model.values[1, 3] == 2.0


def test_costs_of_labels_and_counts_by_hand() -> None:
    model = estimated(graph_of(rows(0, 0, 0), content(0, 0, 0)), ("a", "a", "b"), (None, "a", "b"))
    np.testing.assert_allclose(np.exp(-model.label_costs), [0.5 / 4.5, 2.5 / 4.5, 1.5 / 4.5])
    chances = np.exp(-model.counts)
    np.testing.assert_allclose(chances.sum(axis=1), 1.0)
    assert chances[0, 0] == pytest.approx((1 + 0.25) / 1.5)
    assert chances[1, 2] == pytest.approx((1 + 0.5 * 0.25 / (MOST_COUNTED - 1)) / 1.5)
    assert chances.argmax(axis=1).tolist() == [0, 2, 1]


def test_expectations_are_frequencies_drawn_to_those_of_all_zones() -> None:
    model = estimated(graph_of(rows(0, 0, 0), content(1.0, 1.0, 0.0)), ("a", "a", "b"), (None, "a", "b"))
    overall = 2.05 / 3.5
    assert model.content[1, DATE] == pytest.approx((2 + overall) / 3)
    assert model.content[2, DATE] == pytest.approx(overall / 2)


def test_expectations_stay_away_from_certainty() -> None:
    many = 5000
    model = estimated(graph_of(rows(*[0.0] * many), content(*[1.0] * many)), ("a",) * many, (None, "a"))
    least, most = CONTENT_RANGE
    assert model.content[1, DATE] == most
    assert model.content[1, 1] == least


def relation_rows(descriptors: np.ndarray) -> np.ndarray:
    """All relations with these descriptors, or their last one."""
    last = [len(relation.descriptors) - 1 for relation in RELATIONS]
    return np.minimum(descriptors[:, None], last)


def test_tables_are_least_for_the_dominant_descriptor() -> None:
    # In pairs (a, b) the first descriptor, in all others the second one.
    labels = ("a", "b") * 10
    relations = relation_rows(np.tile([0, 1], 10)[:19])
    model = estimated(graph_of(rows(*[0.0] * 20), content(*[0.0] * 20), relations), labels, (None, "a", "b"))
    for position in range(len(RELATIONS)):
        columns = slice(RELATION_OFFSETS[position], RELATION_OFFSETS[position + 1])
        assert model.relations[1, 2, columns].argmin() == 0
        assert model.relations[2, 1, columns].argmin() == 1
        assert model.relations[1, 2, columns][0] < 0 < model.relations[1, 2, columns][1]
    np.testing.assert_allclose(model.relations[0], 0.0, atol=1e-12, err_msg="pairs never seen cost nothing")


def test_one_pair_by_hand() -> None:
    relations = relation_rows(np.array([0]))
    model = estimated(graph_of(rows(0, 0), content(0, 0), relations), ("a", "b"), (None, "a", "b"))
    overall = np.array([2, 1, 1]) / 4
    expected = -np.log((np.array([1, 0, 0]) + 2 * overall) / 3 / overall)
    np.testing.assert_allclose(model.relations[1, 2, :3], expected)


def test_many_samples_tell_the_truth() -> None:
    rng = np.random.default_rng(7)
    labels = ("a", "b")
    means, deviations = {"a": 0.2, "b": 1.5}, {"a": 0.1, "b": 0.4}
    frequency = {"a": 0.8, "b": 0.1}
    chances = np.array([0.6, 0.3, 0.1])
    pages = []
    for _ in range(60):
        given = tuple(rng.choice(labels, 10))
        numeric = np.stack(
            [rng.normal(means[each], deviations[each], len(NUMERIC_ATTRIBUTES)) for each in given]
        )
        dates = [float(rng.random() < frequency[each]) for each in given]
        descriptor = np.where(
            np.array(given[:-1]) == "a", rng.choice(3, 9, p=chances), rng.choice(3, 9, p=chances[::-1])
        )
        pages.append(LabelledGraph(graph_of(numeric, content(*dates), relation_rows(descriptor)), given))
    known = (None, *labels)
    total = total_statistics([gather_statistics(page, known) for page in pages])
    model = estimate_model(total, known, default_scales(NAMES))
    for row, label in enumerate(known):
        if label is None:
            continue
        error = deviations[label] / np.sqrt(total.zones[row])
        assert np.abs(model.values[row] - means[label]).max() < 4.5 * error
        zones = total.zones[row]
        drawn = (zones * deviations[label] ** 2 + 2 * USUAL) / (zones + 2)
        assert np.abs(model.variances[row] / drawn - 1).max() < 0.35
        assert np.mean(model.variances[row] / drawn) == pytest.approx(1.0, abs=0.06)
        assert model.content[row, DATE] == pytest.approx(frequency[label], abs=0.08)
    seen = model.relations[1, :, :3][1:]
    # Above: log ratios to all pairs, in which both labels are about as frequent.
    assert seen.mean(axis=0) == pytest.approx(-np.log(chances / ((chances + chances[::-1]) / 2)), abs=0.2)


def test_what_is_stored_is_what_was_estimated() -> None:
    rng = np.random.default_rng(3)
    numeric = rng.normal(size=(4, len(NUMERIC_ATTRIBUTES)))
    relations = relation_rows(np.array([0, 1, 2]))
    known = (None, "a", "b")
    statistics = gather_statistics(
        LabelledGraph(graph_of(numeric, content(1, 0, 0.5, 0), relations), ("a", "b", "a", "b")), known
    )
    model = estimate_model(statistics, known, default_scales(NAMES))
    stored = name_parts(model, "x", 1, statistics.zones, NAMES, Calibration(-5.0, 1.0, 0), None, {})
    again = compile_model(stored, NAMES)
    assert stored.labels == again.labels == known
    assert [node.zones for node in stored.nodes] == [0, 2, 2]
    np.testing.assert_allclose(again.values, model.values, atol=1e-5)
    np.testing.assert_allclose(again.variances, model.variances, atol=1e-8)
    np.testing.assert_allclose(again.content, model.content, atol=1e-4)
    for name in ("label_costs", "relations", "counts", "scales"):
        np.testing.assert_allclose(getattr(again, name), getattr(model, name), atol=1e-3, err_msg=name)
