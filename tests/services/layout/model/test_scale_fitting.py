"""Weights of attributes: the slope is right, the answer is one, and noise weighs less than what tells labels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime, minimize

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import DERIVED_FEATURES, LayoutGraph, build_graph
from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES
from services.layout.matching import conditional_costs
from services.layout.model.compiled_model import default_scales, scale_names
from services.layout.model.cost import build_cost_tables
from services.layout.model.estimation import estimate_model
from services.layout.model.scale_fitting import (
    FOLDS,
    conditional_terms,
    fit_scales,
    fit_scales_without,
    hold_out_terms,
    most_probable_scales,
    negative_log_likelihood,
)
from services.layout.model.statistics import LabelledGraph, gather_statistics, label_indices, total_statistics
from services.layout.pipeline import content_features
from tests.services.layout.samples import labelled_page

COLUMNS = [attribute.name for attribute in NUMERIC_ATTRIBUTES]


PRIOR = "services.layout.model.scale_fitting.PRIOR_WEIGHT"


def problem(seed: int, zones: int = 40, labels: int = 3, kinds: int = 5):
    rng = np.random.default_rng(seed)
    terms, truth = rng.normal(size=(zones, labels, kinds)), rng.integers(0, labels, zones)
    return terms, truth, rng.uniform(0, 1, kinds)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 30.0))
def test_the_slope_is_that_of_the_likelihood(seed: int, prior: float) -> None:
    terms, truth, usual = problem(seed)
    at = np.random.default_rng(seed + 1).uniform(0, 2, len(usual))
    rest = (terms, truth, usual, prior)
    numeric = approx_fprime(at, lambda scales: negative_log_likelihood(scales, *rest)[0], 1e-6)
    np.testing.assert_allclose(negative_log_likelihood(at, *rest)[1], numeric, rtol=1e-3, atol=1e-3)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_likelihood_is_convex(seed: int) -> None:
    terms, truth, usual = problem(seed)
    rng = np.random.default_rng(seed + 2)
    a, b = rng.uniform(0, 5, (2, len(usual)))

    def loss(scales: np.ndarray) -> float:
        return negative_log_likelihood(scales, terms, truth, usual, 1.0)[0]

    assert loss((a + b) / 2) < (loss(a) + loss(b)) / 2


def test_the_answer_does_not_depend_on_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    terms, truth, usual = problem(4)
    monkeypatch.setattr(PRIOR, 2.0)
    found = most_probable_scales(terms, truth, usual)
    for start in (np.zeros_like(usual), 5 + 0 * usual):
        other = minimize(
            negative_log_likelihood,
            start,
            args=(terms, truth, usual, 2.0),
            jac=True,
            method="L-BFGS-B",
            bounds=[(0, None)] * len(usual),
        )
        np.testing.assert_allclose(found, other.x, atol=1e-3)
    assert found.min() >= 0


def test_noise_weighs_less_than_what_tells_labels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PRIOR, 5.0)
    rng = np.random.default_rng(1)
    terms, truth, _ = problem(1, zones=600, labels=4, kinds=2)
    # True negative log likelihoods, and as large ones that know nothing of the truth.
    terms[np.arange(600), truth, 0] -= rng.uniform(0, 3, 600)
    usual = np.array([0.5, 0.5])
    informative, noise = most_probable_scales(terms, truth, usual)
    assert informative > 0.6
    assert noise < 0.2


def test_a_strong_prior_keeps_the_usual_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PRIOR, 1e7)
    terms, truth, usual = problem(2)
    near = most_probable_scales(terms, truth, usual)
    np.testing.assert_allclose(near, usual, atol=1e-4)


NAMES = tuple(DERIVED_FEATURES)


def page_with(rng: np.random.Generator) -> LabelledGraph:
    """Three labels that `left` tells and `digits` does not; all other attributes are unknown."""
    labels = tuple(rng.choice(["a", "b", "c"], 8))
    numeric = np.full((8, len(COLUMNS)), np.nan)
    numeric[:, COLUMNS.index("left")] = [{"a": 0.1, "b": 0.2, "c": 0.3}[each] for each in labels]
    numeric[:, COLUMNS.index("left")] += rng.normal(0, 0.02, 8)
    numeric[:, COLUMNS.index("digits")] = rng.normal(0.3, 0.1, 8)
    none = np.zeros((0, 2), np.intp), np.zeros((0, len(RELATIONS)), np.intp)
    return LabelledGraph(LayoutGraph(numeric, np.zeros((8, len(NAMES))), NAMES, *none), labels)


def fitted(pages: list[LabelledGraph]) -> dict[str, float]:
    labels = (None, *sorted({label for page in pages for label in page.labels if label}))
    total = total_statistics(gather_statistics(page, labels) for page in pages)
    samples = [[page] for page in pages]
    scales = fit_scales(hold_out_terms(samples, total, labels)).scales
    return dict(zip(scale_names(pages[0].graph.content_names), scales.tolist(), strict=True))


def test_pages_tell_which_attributes_can_be_trusted() -> None:
    rng = np.random.default_rng(6)
    scales = fitted([page_with(rng) for _ in range(12)])
    usual = dict(zip(scale_names(NAMES), default_scales(NAMES).tolist(), strict=True))
    assert scales["left"] > 1.5 * usual["left"]
    assert scales["digits"] == pytest.approx(usual["digits"], abs=0.15), "it says as little for any label"
    assert scales["top"] == pytest.approx(usual["top"], abs=1e-3), "nothing was seen of it"


@pytest.mark.parametrize("pages", [0, 1])
def test_nothing_is_fitted_where_nothing_can_be_held_out(pages: int) -> None:
    rng = np.random.default_rng(6)
    graphs = [page_with(rng) for _ in range(pages)]
    total = gather_statistics(page_with(rng), (None, "a", "b", "c"))
    names = NAMES if pages else ()
    held_out = hold_out_terms([[page] for page in graphs], total, (None, "a", "b", "c"))
    assert held_out.terms.shape[0] == 0
    np.testing.assert_array_equal(fit_scales(held_out).scales, default_scales(names))


def test_more_samples_than_wanted_are_taken_evenly(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(8)
    pages = [page_with(rng) for _ in range(12)]
    all_ = fitted(pages)
    with monkeypatch.context() as bound:
        bound.setattr("services.layout.model.scale_fitting._MOST_SAMPLES", 4)
        few = fitted(pages)
    assert few["left"] != all_["left"]
    assert few["left"] > few["digits"]
    terms_of_a_page = 8 * 4 * len(default_scales(NAMES))
    monkeypatch.setattr("services.layout.model.scale_fitting._MOST_TERMS", 4.5 * terms_of_a_page)
    assert fitted(pages) == few


@pytest.mark.parametrize("name", ["letter", "two-column"])
def test_terms_are_those_of_the_tables(name: str) -> None:
    """Weighted, they are what changing one label costs in the tables that are matched."""
    features = content_features().names
    pages = []
    for seed in range(3):
        page = labelled_page(name, seed)
        pages.append(LabelledGraph(build_graph(page, features), tuple(zone.label for zone in page.zones)))
    labels = (None, *sorted({label for page in pages for label in page.labels if label}))
    total = total_statistics([gather_statistics(page, labels) for page in pages])
    scales = default_scales(pages[0].graph.content_names)
    model = estimate_model(total, labels, scales)
    given = label_indices(pages[0].labels, labels)
    costs = conditional_terms(pages[0], model, given) @ scales
    expected = conditional_costs(build_cost_tables(pages[0].graph, model), given)
    rows = np.arange(len(given))
    np.testing.assert_allclose(
        costs - costs[rows, given][:, None], expected - expected[rows, given][:, None], atol=1e-8
    )


def test_pages_are_judged_by_models_that_did_not_see_them() -> None:
    """What differs from page to page seems to tell labels only to a model that has seen the page."""
    rng = np.random.default_rng(9)
    labels = tuple("abcdefgh")
    pages = []
    for _ in range(4):
        numeric = np.full((8, len(COLUMNS)), np.nan)
        numeric[:, COLUMNS.index("digits")] = rng.uniform(0, 1, 8)
        none = np.zeros((0, 2), np.intp), np.zeros((0, len(RELATIONS)), np.intp)
        pages.append(LabelledGraph(LayoutGraph(numeric, np.zeros((8, len(NAMES))), NAMES, *none), labels))
    usual = dict(zip(scale_names(NAMES), default_scales(NAMES).tolist(), strict=True))
    assert fitted(pages)["digits"] < usual["digits"]


@pytest.mark.parametrize("count", [2, 7])
def test_weights_without_a_sample_explain_it_no_better(count: int) -> None:
    """Weights of all samples are a compromise between each part and the rest, which those without it need not make."""
    rng = np.random.default_rng(8)
    samples = [[page_with(rng)] for _ in range(count)]
    labels = (None, "a", "b", "c")
    total = total_statistics(gather_statistics(page, labels) for [page] in samples)
    held_out = hold_out_terms(samples, total, labels)
    scales = fit_scales(held_out).scales
    usual = default_scales(NAMES)
    without = fit_scales_without(held_out, scales)
    assert len(without) == count
    for fold in range(min(count, FOLDS)):
        part = [index for index in range(count) if index % FOLDS == fold]
        costs = []
        for weights in (scales, without[fold]):
            cost = 0.0
            for index in part:
                [page] = samples[index]
                model = estimate_model(total - gather_statistics(page, labels), labels, usual)
                given = label_indices(page.labels, labels)
                terms = conditional_terms(page, model, given)
                cost += negative_log_likelihood(weights, terms, given, usual, 0.0)[0]
            costs.append(cost)
        assert costs[1] >= costs[0] - 1e-3
        assert all(without[index] is without[fold] for index in part)
    assert max(np.abs(each - scales).max() for each in without) > 0.01


@pytest.mark.parametrize("count", [2, 7])
def test_weights_without_a_fold_are_those_of_the_other_zones(count: int) -> None:
    rng = np.random.default_rng(11)
    samples = [[page_with(rng)] for _ in range(count)]
    labels = (None, "a", "b", "c")
    total = total_statistics(gather_statistics(page, labels) for [page] in samples)
    held_out = hold_out_terms(samples, total, labels)
    without = fit_scales_without(held_out, fit_scales(held_out).scales)
    for index, found in enumerate(without[:FOLDS]):
        others = held_out.owner % min(count, FOLDS) != index
        anew = most_probable_scales(held_out.terms[others], held_out.truth[others], held_out.usual)
        np.testing.assert_allclose(found, anew, atol=3e-3)
        assert found.min() >= 0


@pytest.mark.parametrize("count", [1, 41])
def test_one_sample_and_many_keep_their_weights(count: int) -> None:
    page = page_with(np.random.default_rng(8))
    total = gather_statistics(page, (None, "a", "b", "c"))
    scales = np.ones(3)
    kept = fit_scales_without(hold_out_terms([[page]] * count, total, (None, "a", "b", "c")), scales)
    assert [each is scales for each in kept] == [True] * count
