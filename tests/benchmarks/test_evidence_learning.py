"""Weights of evidence: known ones are found again, and they are learned from the features that the service uses."""

import numpy as np
import pytest
from scipy.special import expit

from benchmarks.layout.evidence_learning import features_of, fit_weights, log_loss, report, without_texts
from benchmarks.layout.hierarchy import simulated_pages
from benchmarks.layout.protocols import make_model, recognized
from services.layout.pipeline import content_features
from services.layout.recognition.label_evidence import READ, UNREAD, LabelEvidence

TRUE = np.array([0.4, 0.5, -0.3, 0.2, -0.6, 0.3, 0.2, -0.1])


def drawn(zones: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Features, and labels that are right with the probability that `TRUE` gives."""
    rng = np.random.default_rng(seed)
    features = np.hstack([np.ones((zones, 1)), rng.normal(0.0, 2.0, (zones, 7))])
    return features, rng.random(zones) < expit(features @ TRUE)


def test_known_weights_are_found_again() -> None:
    assert fit_weights([drawn(20_000, 1), drawn(10_000, 2)], READ) == pytest.approx(TRUE, abs=0.06)


def test_features_without_a_weight_are_left_out() -> None:
    left_out = np.array(UNREAD.weights) == 0
    assert left_out.tolist() == [False, False, False, False, True, False, True, True]
    found = fit_weights([drawn(5_000, 3)], UNREAD)
    assert found[left_out].tolist() == [0.0, 0.0, 0.0]
    assert np.all(np.abs(found[~left_out]) > 0.05)


def test_a_small_case_weighs_as_much_as_a_large_one() -> None:
    """A third of the labels of one case is right, of the other, which is a hundred times as large, two thirds."""
    features = np.eye(8)[np.zeros(30_000, int)]
    small = features[:300], np.arange(300) % 3 == 0
    large = features, np.arange(30_000) % 3 > 0
    assert expit(fit_weights([small, large], READ)[0]) == pytest.approx(0.5, abs=1e-3)


def test_log_loss_is_that_of_the_definition() -> None:
    loss = log_loss(np.array([0.8, 0.3]), np.array([True, False]))
    assert loss == pytest.approx(-(np.log(0.8) + np.log(0.7)) / 2)


@pytest.mark.parametrize("kind", [READ, UNREAD])
def test_features_are_those_of_the_evidence_that_recognition_gives(kind: LabelEvidence) -> None:
    pages = [content_features().measure_page(page) for page in simulated_pages("simulated memo", 4)]
    if kind is UNREAD:
        pages = [without_texts(page) for page in pages]
    model = make_model("class", [(page, None) for page in pages[:3]])
    seen = recognized(pages[3], {"class": model})
    wanted = [zone.evidence for zone in seen.zones]
    assert features_of(seen, model, kind) @ kind.weights == pytest.approx(wanted)


def test_the_report_judges_each_set_by_weights_of_the_others() -> None:
    cases = {("a", "3"): drawn(2_000, 5), ("b", "3"): drawn(2_000, 6)}
    text = report("read", cases)
    features, is_right = cases["a", "3"]
    loss = log_loss(expit(features @ fit_weights([cases["b", "3"]], READ)), is_right)
    assert f"{loss:.3f}" in next(line for line in text.splitlines() if line.startswith("a, 3 samples"))
