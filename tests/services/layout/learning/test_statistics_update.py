"""Counting pages: one after another gives what initialization gives of all, whatever the order."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.graph.zone_words import NO_TOKENS
from services.layout.learning.learners import learn_page, wrong_zones
from services.layout.learning.statistics_update import moved, update_statistics
from services.layout.model.estimation import estimate_model
from services.layout.model.learning_model import begin_learning, end_learning, with_labels
from services.layout.model.statistics import gather_statistics, sample_statistics, total_statistics
from tests.services.layout.learning.learning_models import ALL_NAMES, classes, learning_model, lesson, seeds


def assert_same(one, other, tolerance: float = 2e-3) -> None:
    for name in ("values", "variances", "content", "label_costs", "relations", "counts"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=tolerance, err_msg=name)


@settings(max_examples=15, deadline=None)
@given(classes, st.lists(seeds, min_size=1, max_size=4, unique=True))
def test_counting_is_initialization_of_all_pages(document_class: str, chosen: list[int]) -> None:
    learned = learning_model(document_class)
    pages = [lesson(document_class, seed) for seed in chosen]
    counted = learned
    for page in pages:
        counted = update_statistics(counted, page, scale_rate=0.0)
    labels = counted.labels
    grown = with_labels(learned, labels)
    total = total_statistics([grown.statistics, *(gather_statistics(page, labels) for page in pages)])
    assert_same(counted.model, estimate_model(total, labels, learned.model.scales))
    assert counted.samples == learned.samples + len(pages)
    assert counted.zones.sum() == learned.zones.sum() + sum(len(page.labels) for page in pages)


def test_two_views_of_a_page_count_as_one_page() -> None:
    learned, page, found = learning_model("memo"), lesson("memo", 5), lesson("memo", 6)
    counted = update_statistics(learned, page, found, scale_rate=0.0)
    grown = with_labels(learned, counted.labels)
    views = sample_statistics([page, found], counted.labels)
    total = total_statistics([grown.statistics, views])
    assert_same(counted.model, estimate_model(total, counted.labels, learned.model.scales))
    assert counted.statistics.pages[0] == learned.statistics.pages[0] + 1
    assert counted.samples == learned.samples + 1
    assert counted.zones.sum() == learned.zones.sum() + len(page.labels)


@settings(max_examples=10, deadline=None)
@given(classes, seeds)
def test_what_was_learned_from_errors_stays(document_class: str, seed: int) -> None:
    learned = learning_model(document_class)
    page = lesson(document_class, seed)
    learned = with_labels(learned, page.labels)
    bent = learned.with_model(replace(learned.model, label_costs=learned.model.label_costs + 0.7))
    plain, kept = (update_statistics(each, page, scale_rate=0.0).model for each in (learned, bent))
    np.testing.assert_allclose(kept.label_costs - plain.label_costs, 0.7)
    assert_same(replace(kept, label_costs=plain.label_costs), plain, 1e-9)


def test_moving_to_the_same_estimate_moves_nothing() -> None:
    learned = learning_model("fax")
    estimate = estimate_model(learned.statistics, learned.labels, learned.model.scales)
    assert_same(moved(learned.model, estimate, estimate), learned.model, 1e-9)


@pytest.mark.parametrize("learner", ["counting", "passive-aggressive", "error-correction"])
def test_a_label_that_the_model_had_not_becomes_a_node(learner) -> None:
    learned = learning_model("memo")
    page = lesson("memo", 2)
    page = replace(page, labels=("never-seen", *page.labels[1:]))
    taught = learn_page(learned, page, learner)
    assert set(taught.labels) == {*learned.labels, *page.labels}
    assert taught.labels[: len(learned.labels)] == learned.labels
    again = begin_learning(end_learning(taught), ALL_NAMES)
    assert again.labels == taught.labels
    if learner != "error-correction":
        assert wrong_zones(again, page) < len(page.labels)


def test_scales_follow_what_tells_labels_apart() -> None:
    """A weight that was lost comes back by the pages that need it."""
    learned = learning_model("letter", 5)
    column = ALL_NAMES.index("date") + learned.model.values.shape[1]
    scales = learned.model.scales.copy()
    scales[column] = 0.0
    lost = replace(learned.with_model(replace(learned.model, scales=scales)), certainty=np.zeros_like(scales))
    found = [0.0]
    for seed in range(6):
        page = lesson("letter", seed)
        page = replace(page, graph=replace(page.graph, tokens=NO_TOKENS))  # words would tell the same
        lost = update_statistics(lost, page)
        found.append(float(lost.model.scales[column]))
    assert 0 < found[2] < found[-1]
    assert (lost.model.scales >= 0).all()


def test_old_pages_fade(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a change of the class its new look is what is expected."""
    monkeypatch.setattr("services.layout.learning.statistics_update.MOST_PAGES", 4.0)
    learned = learning_model("letter", 5)
    page = lesson("letter", 1)
    for _ in range(30):
        learned = update_statistics(learned, page, scale_rate=0.0)
    assert learned.statistics.pages[0] == pytest.approx(4.0, abs=1e-3)
    alone = gather_statistics(page, learned.labels)
    seen = alone.zones > 0
    np.testing.assert_allclose(learned.statistics.zones[seen], 4 * alone.zones[seen], rtol=1e-2)
    assert learned.samples == 35


def test_counting_an_empty_page_counts_no_zone() -> None:
    learned = learning_model("memo")
    page = lesson("memo", 0)
    graph = replace(
        page.graph,
        numeric=page.graph.numeric[:0],
        content=page.graph.content[:0],
        pairs=page.graph.pairs[:0],
        relations=page.graph.relations[:0],
        tokens=NO_TOKENS,
    )
    counted = update_statistics(learned, replace(page, graph=graph, labels=()))
    assert counted.zones.sum() == learned.zones.sum()
    assert counted.statistics.pages[0] == learned.statistics.pages[0] + 1
