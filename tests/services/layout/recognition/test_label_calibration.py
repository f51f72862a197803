"""Calibrated confidences of labels: a known line is found again, and one page hardly changes what is usual."""

import numpy as np
import pytest
from scipy.special import expit

from services.layout.model.layout_model import USUAL_INTERCEPT, USUAL_SLOPE, Calibration, LayoutModel
from services.layout.page import Page, Zone
from services.layout.recognition.label_calibration import (
    HeldOutZones,
    calibrate_labels,
    judge_labels,
    with_believable_labels,
)
from services.layout.recognition.page_recognition import VersionedModel
from services.layout.recognition.results import ClassMatch, LabelledZone, Recognition

BEGUN = Calibration(-6.0, 1.0, 3)


def drawn(slope: float, intercept: float, zones: int, seed: int) -> HeldOutZones:
    """Zones whose labels are right with the probability that a line of the log odds gives."""
    rng = np.random.default_rng(seed)
    log_odds = rng.normal(3.0, 2.0, zones)
    return HeldOutZones(expit(log_odds), rng.random(zones) < expit(slope * log_odds + intercept))


@pytest.mark.parametrize(("slope", "intercept"), [(0.5, -1.0), (0.8, -0.3)])
def test_the_line_of_many_zones_is_found_again(slope: float, intercept: float) -> None:
    found = calibrate_labels(BEGUN, [drawn(slope, intercept, 3000, seed) for seed in range(4)], 4)
    assert found.label_slope == pytest.approx(slope, abs=0.05)
    assert found.label_intercept == pytest.approx(intercept, abs=0.12)
    assert (found.mean, found.pages, found.label_zones) == (-6.0, 3, 12000)


def test_without_held_out_pages_the_line_is_the_usual_one() -> None:
    assert calibrate_labels(BEGUN, [], 1) == BEGUN
    assert (BEGUN.label_slope, BEGUN.label_intercept) == (USUAL_SLOPE, USUAL_INTERCEPT)


def test_a_page_of_right_labels_is_not_believed_blindly() -> None:
    """Ten right zones raise the confidence, and leave it far from certain."""
    right = HeldOutZones(np.full(10, 0.9), np.ones(10, bool))
    found = calibrate_labels(BEGUN, [right], 1)
    usual = expit(USUAL_SLOPE * np.log(9.0) + USUAL_INTERCEPT)
    believed = expit(found.label_slope * np.log(9.0) + found.label_intercept)
    assert usual < believed < 0.95
    wrong = calibrate_labels(BEGUN, [HeldOutZones(right.confidence, ~right.is_right)], 1)
    assert expit(wrong.label_slope * np.log(9.0) + wrong.label_intercept) < usual


def test_models_of_more_samples_are_believed_more() -> None:
    held_out = [HeldOutZones(np.full(10, 0.9), np.arange(10) > 1)]
    lines = [calibrate_labels(BEGUN, held_out, samples) for samples in (2, 5, 20)]
    assert lines[0].label_intercept < lines[1].label_intercept < lines[2].label_intercept


def test_labels_are_judged_by_their_costs() -> None:
    conditional = np.array([[0.0, np.log(3.0)], [np.log(9.0), 0.0]])
    judged = judge_labels(conditional, np.array([0, 1]), np.array([0, 0]))
    assert judged.confidence == pytest.approx([0.75, 0.9])
    assert judged.is_right.tolist() == [True, False]


def recognition(*confidences: float, name: str = "letter") -> Recognition:
    zones = tuple(Zone(f"z{n}", (0.0, 10.0 * n, 50.0, 10.0 * n + 8)) for n in range(len(confidences)))
    labelled = (
        LabelledZone(zone, "a", confidence, "a", order)
        for order, (zone, confidence) in enumerate(zip(zones, confidences, strict=True))
    )
    classes = (ClassMatch(name, 1, -3.0, 0.4),)
    return Recognition(Page(100.0, 100.0, zones), tuple(labelled), None, classes)


def test_confidences_keep_their_order_and_their_range() -> None:
    model = LayoutModel("letter", 1, (), (), {}, Calibration(-5.0, 1.0, 0, 0.0, 0.5, -1.0, 40))
    found = with_believable_labels(recognition(0.0, 0.2, 0.5, 0.9, 1.0), [VersionedModel(model, 1)])
    sure = [each.confidence for each in found.zones]
    assert sure == sorted(sure)
    assert 0.0 < sure[0] < sure[-1] < 1.0
    assert sure[3] == pytest.approx(expit(0.5 * np.log(9.0) - 1.0))
    other = recognition(0.9, name="memo")
    assert with_believable_labels(other, [VersionedModel(model, 1)]) == other
