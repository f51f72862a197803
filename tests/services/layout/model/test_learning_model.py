"""Models are stored and opened again without losing what they have learned or seen."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from services.layout.learning.learners import learn_page
from services.layout.model.compiled_model import compile_model
from services.layout.model.learning_model import begin_learning, end_learning, with_labels
from services.layout.model.model_document import model_from_document, model_to_document
from services.layout.model.statistics import MOST_COUNTED
from tests.services.layout.learning.learning_models import ALL_NAMES, classes, learning_model, lesson, seeds
from tests.services.layout.samples import model_of

ARRAYS = ("values", "variances", "content", "weights", "label_costs", "relations", "counts", "scales")


@pytest.mark.pipeline
@settings(max_examples=15, deadline=None)
@given(classes, seeds)
def test_what_was_learned_is_stored(document_class: str, seed: int) -> None:
    learned = learn_page(learning_model(document_class), lesson(document_class, seed), "passive-aggressive")
    stored = model_from_document(model_to_document(end_learning(learned)))
    again = begin_learning(stored, ALL_NAMES)
    assert again.labels == learned.labels
    for name in ARRAYS:
        one, other = getattr(learned.model, name), getattr(again.model, name)
        np.testing.assert_allclose(other, one, atol=6e-4, err_msg=name)
    for name in ("zones", "known", "totals", "squares", "read", "content", "descriptors", "counts", "pages"):
        one, other = getattr(learned.statistics, name), getattr(again.statistics, name)
        np.testing.assert_allclose(other, one, atol=1e-5, err_msg=name)
    np.testing.assert_allclose(again.certainty, learned.certainty, atol=1e-4)
    assert (again.samples, again.zones.tolist()) == (learned.samples, learned.zones.tolist())
    assert model_to_document(end_learning(again)) == model_to_document(end_learning(learned))


@pytest.mark.parametrize("document_class", ["letter", "two-column"])
def test_a_model_without_statistics_learns_from_what_it_presumes(document_class: str) -> None:
    known = model_of(document_class, 4)
    forgetful = replace(known, statistics=None)
    page = lesson(document_class, 5)
    presumed = begin_learning(forgetful, ALL_NAMES)
    assert presumed.statistics.pages[0] == known.samples
    np.testing.assert_allclose(presumed.statistics.counts.sum(axis=1), known.samples)
    assert np.isfinite(presumed.statistics.descriptors).all()
    taught, remembering = (
        learn_page(begin_learning(each, ALL_NAMES), page, "counting").model for each in (forgetful, known)
    )
    # About the same: a page of five moves typical values alike.
    both = np.isfinite(taught.values) & np.isfinite(remembering.values)
    spread = np.sqrt(remembering.variances[both])
    assert np.median(np.abs(taught.values[both] - remembering.values[both]) / spread) < 0.1
    assert np.isfinite(taught.relations).all()
    assert np.isfinite(taught.counts).all()


def test_nodes_that_are_added_cost_what_is_usual_and_leave_the_others_alone() -> None:
    learned = learning_model("fax")
    grown = with_labels(learned, ("new", None, learned.labels[1]))
    old = len(learned.labels)
    assert grown.labels == (*learned.labels, "new")
    shift = grown.model.label_costs[:old] - learned.model.label_costs
    np.testing.assert_allclose(shift, shift[0], err_msg="no label gains upon another")
    for name in ("values", "variances", "content", "weights"):
        np.testing.assert_array_equal(getattr(grown.model, name)[:old], getattr(learned.model, name))
    np.testing.assert_array_equal(grown.model.relations[:old, :old], learned.model.relations)
    assert grown.model.counts.shape == (old + 1, MOST_COUNTED + 1)
    assert grown.zones[-1] == 0
    assert with_labels(grown, ("new",)) is grown


def test_a_model_of_other_features_is_opened_with_what_is_known() -> None:
    model = model_of("memo", 2)
    names = (*ALL_NAMES, "never-measured")
    learned = begin_learning(model, names)
    assert np.isnan(learned.model.content[:, -1]).all()
    assert not learned.statistics.read[:, -1].any()
    np.testing.assert_array_equal(learned.model.values, compile_model(model, ALL_NAMES).values)
