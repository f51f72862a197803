"""Calibrated confidences of labels: a known line is found again, and one page hardly changes what is usual."""

import numpy as np
import pytest
from scipy.special import expit

from services.layout.matching.cost_tables import CostTables
from services.layout.model.layout_model import Calibration, LayoutModel
from services.layout.page import Page, Zone
from services.layout.recognition.label_calibration import (
    HeldOutZones,
    calibrate_labels,
    judge_labels,
    with_believable_labels,
)
from services.layout.recognition.label_evidence import label_evidence
from services.layout.recognition.page_recognition import VersionedModel
from services.layout.recognition.results import ClassMatch, Recognition, RecognizedZone

BEGUN = Calibration(-6.0, 1.0, 3)


def drawn(slope: float, intercept: float, zones: int, seed: int) -> HeldOutZones:
    """Zones whose labels are right with the probability that a line of the evidence gives."""
    rng = np.random.default_rng(seed)
    evidence = rng.normal(1.5, 1.5, zones)
    return HeldOutZones(evidence, rng.random(zones) < expit(slope * evidence + intercept))


@pytest.mark.parametrize(("slope", "intercept"), [(0.7, -1.0), (1.3, 0.4)])
def test_the_line_of_many_zones_is_found_again(slope: float, intercept: float) -> None:
    found = calibrate_labels(BEGUN, [drawn(slope, intercept, 3000, seed) for seed in range(4)])
    assert found.evidence_slope == pytest.approx(slope, abs=0.08)
    assert found.evidence_intercept == pytest.approx(intercept, abs=0.12)
    assert (found.mean, found.pages, found.evidence_zones) == (-6.0, 3, 12000)


def test_without_held_out_pages_evidence_stays_as_it_is() -> None:
    assert calibrate_labels(BEGUN, []) == BEGUN
    assert (BEGUN.evidence_slope, BEGUN.evidence_intercept) == (1.0, 0.0)


def test_a_page_of_right_labels_is_not_believed_blindly() -> None:
    """Ten right zones raise the confidence a little, ten wrong ones lower it."""
    right = HeldOutZones(np.full(10, 1.0), np.ones(10, bool))
    found = calibrate_labels(BEGUN, [right])
    believed = expit(found.evidence_slope + found.evidence_intercept)
    assert expit(1.0) < believed < 0.85
    wrong = calibrate_labels(BEGUN, [HeldOutZones(right.evidence, ~right.is_right)])
    assert 0.4 < expit(wrong.evidence_slope + wrong.evidence_intercept) < expit(1.0)


@pytest.mark.parametrize("is_read", [True, False])
def test_labels_are_judged_by_their_evidence(is_read: bool) -> None:
    node = np.array([[0.0, np.log(3.0)], [np.log(9.0), 0.0]])
    tables = CostTables(node, np.zeros((0, 2), np.intp), np.zeros((0, 2, 2)), np.zeros((2, 3)))
    judged = judge_labels(tables, np.array([0, 1]), np.array([0, 0]), 4, is_read=is_read)
    assert judged.is_right.tolist() == [True, False]
    assert judged.evidence == pytest.approx(
        label_evidence(tables, np.array([0, 1]), node + 0.0, 4, is_read=is_read)
    )


def recognition(*evidence: float | None, name: str = "letter") -> Recognition:
    zones = tuple(Zone(f"z{n}", (0.0, 10.0 * n, 50.0, 10.0 * n + 8)) for n in range(len(evidence)))
    labelled = (
        RecognizedZone(zone, "a", 0.9, "a", order, each)
        for order, (zone, each) in enumerate(zip(zones, evidence, strict=True))
    )
    classes = (ClassMatch(name, 1, -3.0, 0.4),)
    return Recognition(Page(100.0, 100.0, zones), tuple(labelled), None, classes)


def test_confidences_are_the_line_of_the_evidence() -> None:
    model = LayoutModel("letter", 1, (), (), {}, Calibration(-5.0, 1.0, 0, 0.0, 0.5, -1.0, 40))
    found = with_believable_labels(recognition(-50.0, -1.0, 0.0, 2.0, 50.0), [VersionedModel(model, 1)])
    sure = [each.confidence for each in found.zones]
    assert sure == sorted(sure)
    assert 0.0 < sure[0] < sure[-1] < 1.0
    assert sure[3] == pytest.approx(0.5)


def test_what_was_not_matched_by_the_model_stays() -> None:
    model = LayoutModel("letter", 1, (), (), {}, Calibration(-5.0, 1.0, 0))
    other = recognition(0.9, name="memo")
    assert with_believable_labels(other, [VersionedModel(model, 1)]) == other
    unmatched = recognition(None)
    assert with_believable_labels(unmatched, [VersionedModel(model, 1)]) == unmatched
