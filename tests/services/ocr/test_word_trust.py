"""Calibrated confidences of words: monotonous, bounded, and learned again from words that are right by them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.rectify.text_confidence import learn, trusted
from services.ocr.word_trust import LARGEST, LEAST, WordTrust, confidence_for, probability_right


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_surer_word_is_more_probably_right(one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert 0.0 < probability_right(low) <= probability_right(high) <= 1.0


@pytest.mark.parametrize(
    ("confidence", "least", "most"), [(0.965, 0.99, 1.0), (0.85, 0.85, 0.93), (0.5, 0.25, 0.4)]
)
def test_probabilities_are_those_that_were_measured(confidence: float, least: float, most: float) -> None:
    assert least < probability_right(confidence) < most


@given(st.floats(LEAST, LARGEST))
def test_a_probability_has_the_confidence_that_means_it(confidence: float) -> None:
    assert confidence_for(probability_right(confidence)) == pytest.approx(confidence, abs=2e-3)
    assert confidence_for(0.0) == LEAST
    assert confidence_for(1.0) == LARGEST


def test_the_coefficients_are_learned_from_words() -> None:
    rng = np.random.default_rng(5)
    confidence = rng.uniform(0.02, 0.98, 40_000)
    true = WordTrust(-1.0, 0.5, 1.5)
    is_right = rng.random(len(confidence)) < trusted(confidence, true)
    found = learn(confidence, is_right)
    assert (found.constant, found.of_confidence, found.of_doubt) == pytest.approx((-1.0, 0.5, 1.5), abs=0.1)
