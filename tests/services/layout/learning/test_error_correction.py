"""The dissertation's update: every step brings the right labelling nearer to the least cost."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES
from services.layout.learning.error_correction import correct_errors
from services.layout.learning.learners import correct_page, match_page
from services.layout.model.compiled_model import SUREST
from services.layout.model.cost import labelling_cost
from services.layout.model.statistics import label_indices
from tests.services.layout.learning.learning_models import (
    classes,
    known_lesson,
    learning_model,
    mislabelled,
    seeds,
)


@pytest.mark.pipeline
@settings(max_examples=60, deadline=None)
@given(classes, seeds, st.floats(0.0, 0.6))
def test_the_difference_of_costs_falls(document_class: str, seed: int, share: float) -> None:
    """C'(h*) - C'(h) < C(h*) - C(h), for any wrong h (5.5)."""
    learned = learning_model(document_class)
    page = known_lesson(learned, document_class, seed)
    truth = label_indices(page.labels, learned.labels)
    found = mislabelled(learned, page, seed, share)
    corrected = correct_errors(learned.model, page.graph, truth, found)

    def difference(model) -> float:
        right, wrong = (
            sum(labelling_cost(page.graph, model, labels, model.scales)) for labels in (truth, found)
        )
        return right - wrong

    assert difference(corrected) < difference(learned.model)
    assert (corrected.weights >= 0).all()
    assert np.nanmin(corrected.content) >= SUREST
    assert np.nanmax(corrected.content) <= 1 - SUREST
    np.testing.assert_array_equal(corrected.variances, learned.model.variances)


def test_a_right_labelling_changes_nothing() -> None:
    learned = learning_model("letter")
    page = known_lesson(learned, "letter", 0)
    truth = label_indices(page.labels, learned.labels)
    assert correct_errors(learned.model, page.graph, truth, truth) is learned.model


def test_values_move_towards_the_right_zone_and_weights_fall_where_they_misled() -> None:
    learned = learning_model("letter")
    page = known_lesson(learned, "letter", 3)
    truth = label_indices(page.labels, learned.labels)
    zone = int(np.flatnonzero(truth > 0)[0])
    found = truth.copy()
    found[zone] = 0  # as d to null instead of A in Figure 5.5
    node, column = truth[zone], [each.name for each in NUMERIC_ATTRIBUTES].index("top")
    model = replace(learned.model, values=learned.model.values.copy())
    model.values[node, column] = page.graph.numeric[zone, column] + 0.4  # unreliable: far from the right zone
    corrected = correct_errors(model, page.graph, truth, found)
    before, after = (
        abs(each.values[node, column] - page.graph.numeric[zone, column]) for each in (model, corrected)
    )
    assert 0.85 * before < after < 0.95 * before
    assert corrected.weights[node, column] < model.weights[node, column]


def test_what_persists_is_learned_in_the_end() -> None:
    """If the problem repeats itself, eventually C(h) > C(h*)."""
    learned = learning_model("letter", 1)
    page = known_lesson(learned, "letter", 3)
    truth = label_indices(page.labels, learned.labels)
    errors = [int((match_page(learned, page.graph) != truth).sum())]
    assert errors[0] > 0, "the page is chosen so that there is something to learn"
    for _ in range(60):
        learned, changed = correct_page(learned, page, "error-correction")
        errors.append(int((match_page(learned, page.graph) != truth).sum()))
        if not changed:
            break
    assert errors[-1] == 0
