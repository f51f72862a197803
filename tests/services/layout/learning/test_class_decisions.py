"""What decisions on classes teach: the page is decided rightly by a margin, or nearer to it by the largest step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.layout.learning.class_decisions import (
    MOST_STEP,
    accept_page,
    count_cost,
    prefer_class,
    refuse_page,
)
from services.layout.model.layout_model import Calibration
from services.layout.recognition.classification import calibrate, classify

costs = st.floats(-12.0, 3.0)
calibrations = st.builds(
    Calibration, st.floats(-12.0, -2.0), st.floats(0.1, 2.0), st.integers(0, 50), st.floats(-2.0, 2.0)
)


@given(st.lists(costs, min_size=1, max_size=30))
def test_counting_costs_is_calibration_of_all(all_costs: list[float]) -> None:
    counted = calibrate([])
    for cost in all_costs:
        counted = count_cost(counted, cost)
    whole = calibrate(all_costs)
    assert counted.pages == whole.pages
    assert counted.mean == pytest.approx(whole.mean, abs=1e-6)
    assert counted.deviation == pytest.approx(whole.deviation, abs=1e-6)


@given(costs, calibrations, costs, calibrations)
def test_the_right_class_gains(
    right: float, of_right: Calibration, wrong: float, of_wrong: Calibration
) -> None:
    def odds(first: Calibration, second: Calibration) -> float:
        among, _ = classify(np.array([right, wrong]), [first, second], 15)
        return float(np.log(max(among[0], 1e-200)) - np.log(max(among[1], 1e-200)))

    before = odds(of_right, of_wrong)
    taught = prefer_class((right, of_right), (wrong, of_wrong))
    after = odds(*taught)
    assert abs(taught[0].bias - of_right.bias) <= MOST_STEP + 1e-9
    assert abs(taught[1].bias - of_wrong.bias) <= MOST_STEP + 1e-9
    if before >= 1:
        assert after == pytest.approx(before)
    elif abs(before) < 100:  # beyond it probabilities are too small for odds
        assert after > before
        assert after == pytest.approx(min(1.0, before + 6 * MOST_STEP), abs=1e-6)


@given(costs, calibrations, st.integers(1, 60))
def test_a_page_taken_for_none_is_accepted_sooner(cost: float, calibration: Calibration, zones: int) -> None:
    taught = accept_page(cost, calibration, zones)
    before, after = (classify(np.array([cost]), [each], zones)[1] for each in (calibration, taught))
    assert after <= before
    assert abs(taught.bias - calibration.bias) <= MOST_STEP + 1e-9


@given(costs, calibrations, st.integers(1, 60))
def test_a_page_of_no_class_is_refused_sooner(cost: float, calibration: Calibration, zones: int) -> None:
    taught = refuse_page(cost, calibration, zones)
    before, after = (classify(np.array([cost]), [each], zones)[1] for each in (calibration, taught))
    assert after >= before
    assert abs(taught.bias - calibration.bias) <= MOST_STEP + 1e-9


@pytest.mark.parametrize("zones", [3, 30, 100])
def test_repeated_it_is_decided_by_a_margin(zones: int) -> None:
    calibration = Calibration(-6.0, 0.8, 10)
    refusing = calibration
    for _ in range(30):
        refusing = refuse_page(-6.0, refusing, zones)
    assert classify(np.array([-6.0]), [refusing], zones)[1] == pytest.approx(1 / (1 + np.exp(-1)), abs=1e-6)
    for _ in range(30):
        refusing = accept_page(-6.0, refusing, zones)
    assert classify(np.array([-6.0]), [refusing], zones)[1] == pytest.approx(1 / (1 + np.exp(1)), abs=1e-6)
