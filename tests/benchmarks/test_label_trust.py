"""The figures of calibration on confidences whose errors are known."""

import numpy as np
import pytest

from benchmarks.layout.label_trust import accepted_share, error_of_shares, expected_error


def test_true_confidences_have_no_error_and_boasts_have_one() -> None:
    rng = np.random.default_rng(4)
    confidence = rng.uniform(0.5, 1.0, 40_000)
    is_right = rng.random(len(confidence)) < confidence
    assert expected_error((confidence, is_right)) < 0.01
    boasting = np.minimum(confidence + 0.1, 1.0)
    assert expected_error((boasting, is_right)) == pytest.approx(0.09, abs=0.01)


def test_the_most_confident_zones_are_accepted_while_few_are_wrong() -> None:
    confidence = np.linspace(1.0, 0.0, 200)
    is_right = np.ones(200, bool)
    is_right[[120, 121, 122]] = False
    assert error_of_shares((confidence, is_right))[120] == pytest.approx(1 / 121)
    assert accepted_share((confidence, is_right)) == pytest.approx(121 / 200)
    assert accepted_share((confidence, ~is_right)) == 0.0
