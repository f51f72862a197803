"""Classes from least costs: by hand, monotone, and an unknown that is told as such."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.model.layout_model import Calibration
from services.layout.recognition.classification import (
    LEAST_FIT,
    SHARE_OF_MEAN,
    calibrate,
    classify,
    least_fit,
)

ZONES = 15
calibrations = st.builds(Calibration, st.floats(-20, 5), st.floats(0.01, 3), st.integers(0, 50))
competitors = st.lists(st.tuples(st.floats(-30, 50), calibrations), min_size=1, max_size=6)


def split(classes: list[tuple[float, Calibration]]) -> tuple[np.ndarray, list[Calibration]]:
    return np.array([cost for cost, _ in classes]), [calibration for _, calibration in classes]


@settings(deadline=None)
@given(competitors)
def test_probabilities_sum_to_one(classes: list[tuple[float, Calibration]]) -> None:
    probabilities, unknown = classify(*split(classes), ZONES)
    assert probabilities.sum() + unknown == pytest.approx(1.0)
    assert probabilities.min() >= 0
    assert 0 <= unknown <= 1


@settings(deadline=None)
@given(competitors, st.randoms(use_true_random=False))
def test_the_order_of_models_says_nothing(classes: list[tuple[float, Calibration]], random) -> None:
    order = random.sample(range(len(classes)), len(classes))
    costs, told = split(classes)
    probabilities, unknown = classify(costs, told, ZONES)
    others, other_unknown = classify(*split([classes[index] for index in order]), ZONES)
    excess = costs - SHARE_OF_MEAN * np.array([each.mean for each in told])
    if len(set(np.round(excess, 9))) == len(excess):  # of equals the first is the nearest
        np.testing.assert_allclose(others, probabilities[order], rtol=1e-9, atol=1e-300)
        assert other_unknown == pytest.approx(unknown)


@settings(deadline=None)
@given(st.floats(-12, 2), st.floats(0.01, 5), st.floats(-12, 2))
def test_a_lower_cost_makes_a_class_more_probable(cost: float, less: float, other: float) -> None:
    told = [Calibration(-6.0, 1.0, 5)] * 2
    before, unknown_before = classify(np.array([cost, other]), told, ZONES)
    after, unknown_after = classify(np.array([cost - less, other]), told, ZONES)
    assert after[0] > before[0] or before[0] == pytest.approx(1.0, abs=1e-6)
    assert unknown_after <= unknown_before


def test_one_class_by_hand() -> None:
    for share, odds in ((0.56, 0.0), (0.76, 3.0), (0.36, -3.0)):
        probabilities, unknown = classify(np.array([-6.0 * share]), [Calibration(-6.0, 1.0, 5)], 20)
        assert probabilities[0] == pytest.approx(1 / (1 + np.exp(-odds)))
        assert unknown == pytest.approx(1 / (1 + np.exp(odds)))


def test_two_classes_by_hand() -> None:
    told = [Calibration(-6.0, 1.0, 5), Calibration(-10.0, 1.0, 5)]
    probabilities, _ = classify(np.array([-6.0, -6.4]), told, ZONES)
    # excess -6 + 2.4 and -6.4 + 4
    assert probabilities[0] / probabilities[1] == pytest.approx(np.exp(3.0 * 1.2))


def test_the_nearest_class_is_first_however_bad_it_fits() -> None:
    told = [Calibration(-6.0, 1.0, 5)] * 3
    for worst in (50.0, 1e3, 1e7):
        probabilities, unknown = classify(np.array([worst, worst - 2, worst + 5]), told, ZONES)
        assert unknown == pytest.approx(1.0)
        assert probabilities.argmax() == 1
        assert probabilities[1] > 0
    probabilities, unknown = classify(np.array([-1e7, -5.0]), told[:2], ZONES)
    assert probabilities[0] == pytest.approx(1.0)
    assert unknown < 1e-100


def test_a_page_of_no_class_is_unknown() -> None:
    told = [Calibration(-6.0, 1.0, 5), Calibration(-8.0, 1.0, 5)]
    assert classify(np.array([-2.0, -1.0]), told, ZONES)[1] > 0.9
    assert classify(np.array([-6.0, -1.0]), told, ZONES)[1] < 0.01


def test_the_same_cost_says_more_of_a_page_of_many_zones() -> None:
    told = [Calibration(-6.0, 1.0, 5)]
    few, many = (classify(np.array([-3.0]), told, zones)[1] for zones in (20, 30))
    # The share that is enough falls by 0.153 of log 1.5, at log odds of 15 for each unit.
    assert np.log(few / (1 - few)) - np.log(many / (1 - many)) == pytest.approx(15 * 0.153 * np.log(1.5))
    assert least_fit(0) == least_fit(1) == least_fit(20) == LEAST_FIT
    assert least_fit(500) == least_fit(40) == pytest.approx(LEAST_FIT - 0.153 * np.log(2))


def test_costs_are_calibrated_by_hand() -> None:
    assert calibrate([]) == Calibration(-5.5, pytest.approx(0.8), 0)
    found = calibrate([-6.0])
    mean = (-6.0 - 0.5 * 5.5) / 1.5
    assert found.mean == pytest.approx(mean)
    assert found.deviation == pytest.approx(np.sqrt(((-6 - mean) ** 2 + 2 * 0.64) / 3))
    assert found.pages == 1


def test_many_pages_calibrate_by_themselves() -> None:
    costs = np.random.default_rng(0).normal(-9.0, 1.5, 4000)
    found = calibrate(costs.tolist())
    assert found.mean == pytest.approx(-9.0, abs=0.1)
    assert found.deviation == pytest.approx(1.5, abs=0.1)
    assert calibrate(costs[::-1].tolist()).mean == pytest.approx(found.mean)


def test_wrong_calibrations_do_not_break_it() -> None:
    probabilities, unknown = classify(np.array([3.0]), [Calibration(1e9, 1e-6, 0)], ZONES)
    assert np.isfinite(probabilities).all()
    assert probabilities.sum() + unknown == pytest.approx(1.0)
