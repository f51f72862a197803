"""Decisions: bounds against exact binomial sums, thresholds that keep their promise, reasons."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import beta

from app.review.decisions import (
    CANDIDATES,
    CERTAINTY,
    decide,
    place_in_queue,
    threshold_of,
    tolerated_errors_of,
    verdicts_of,
)
from app.schemas.layout import result_of
from app.settings import Settings
from services.contract.answers.layout import DocumentClass, LayoutResult
from services.contract.answers.tables import ItemTable, TableChecks
from tests.app.scripted_results import layout_document


def _result() -> LayoutResult:
    page = {"width": 9, "height": 9, "zones": [{"id": f"z{n}", "box": [0, 0, 1, 1]} for n in (1, 2)]}
    result = result_of(layout_document(page, [], [], {}), "")
    result.class_ = DocumentClass(name="letter", probability=0.99, model_version=3, cost=1.0)
    result.zones[0].label, result.zones[0].confidence = "date", 0.999
    result.zones[1].label, result.zones[1].confidence = "body", 0.6
    return result


RESULT = _result()


def test_without_evidence_nothing_is_accepted() -> None:
    assert threshold_of([], 0.01) is None
    assert threshold_of([("date", 1.0, True)] * 100, 0.01) is None  # 100 right zones show an error of 5 %
    assert threshold_of([("date", 1.0, True)] * 600, 0.01) == 0.0


@given(st.integers(0, 20), st.integers(1, 600), st.floats(0.001, 0.5))
def test_zones_are_accepted_where_the_bound_allows_it(wrong: int, total: int, tolerated: float) -> None:
    verdicts = [(None, 1.0, number >= wrong) for number in range(total)]
    """By Clopper and Pearson's bound, which scipy has as a quantile of the beta distribution."""
    certainty = 1 - (1 - CERTAINTY) / len(CANDIDATES)
    bound = beta.ppf(certainty, wrong + 1, total - wrong) if wrong < total else 1.0
    assert (threshold_of(verdicts, tolerated) is not None) == (bound <= tolerated)


def test_the_error_of_accepted_zones_is_as_stated() -> None:
    """Over 100 sets of feedback, the true error above the threshold exceeds the tolerated one at most as often as
    stated; thresholds are found, and they let most zones through."""
    rng, tolerated, broken, shares = np.random.default_rng(5), 0.03, 0, []
    for _ in range(100):
        confidences = rng.beta(6, 0.5, 2000)
        rights = rng.random(2000) < confidences
        verdicts = [(None, float(c), bool(r)) for c, r in zip(confidences, rights, strict=True)]
        threshold = threshold_of(verdicts, tolerated)
        if threshold is None:
            continue
        new = rng.beta(6, 0.5, 20_000)
        accepted = new[new >= threshold]
        shares.append(len(accepted) / len(new))
        broken += (1 - accepted).mean() > tolerated
    assert len(shares) > 90
    assert np.mean(shares) > 0.4
    assert broken <= (1 - CERTAINTY) * 100


def test_reasons_name_the_zones() -> None:
    decision = decide(RESULT, [("date", 0.99, True)] * 600 + [("body", 0.6, False)] * 30, {None: 0.01})
    assert decision.action == "review"
    assert [(reason.code, reason.zones) for reason in decision.reasons] == [("unsure", ["z2"])]
    assert decide(RESULT, [], {None: 0.01}).reasons[0].code == "no-evidence"
    assert decide(RESULT.model_copy(update={"class_": None}), [], {None: 0.01}).reasons[0].code == "no-class"
    assert decide(RESULT, [("date", 0.5, True)] * 600, {None: 0.01}).action == "accept"


def test_a_label_may_have_a_stricter_error() -> None:
    verdicts = [("body", 0.5, True)] * 600 + [("date", 0.5, True)] * 50
    decision = decide(RESULT, verdicts, {None: 0.01, "date": 0.01})
    assert [(reason.code, reason.zones) for reason in decision.reasons] == [("no-evidence", ["z1"])]


def test_a_wrong_class_makes_every_zone_wrong() -> None:
    rights = [right for _, _, right in verdicts_of(RESULT, ["z2"], ["z1", "z2"], class_is_right=True)]
    assert rights == [True, False]
    assert not any(right for *_, right in verdicts_of(RESULT, [], ["z1", "z2"], class_is_right=False))
    assert [right for *_, right in verdicts_of(RESULT, [], ["z2"], class_is_right=True)] == [False, True]


def test_the_gain_is_the_expected_number_of_wrong_zones() -> None:
    place = place_in_queue(RESULT)
    assert place.gain == pytest.approx(2 - 0.99 * 1.599)
    assert place.confidence == pytest.approx(0.99 * 0.6)


def test_tolerated_errors_are_read_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOLERATED_ERRORS", "0.02, letter=0.005, letter/date=0.001")
    settings = Settings()
    assert tolerated_errors_of("memo", settings.tolerated_errors) == {None: 0.02}
    assert tolerated_errors_of("letter", settings.tolerated_errors) == {None: 0.005, "date": 0.001}
    monkeypatch.setenv("TOLERATED_ERRORS", "letter=2")
    with pytest.raises(ValueError, match="letter"):
        Settings()


def test_numbers_that_do_not_say_the_same_are_reasons() -> None:
    verdicts = [(label, 1.0, True) for label in ("date", "body") for _ in range(600)]
    result = RESULT.model_copy(deep=True)
    for zone in result.zones:
        zone.confidence = 1.0
    result.class_ = DocumentClass(name="letter", probability=1.0, model_version=3, cost=1.0)
    assert decide(result, verdicts, {None: 0.01}).action == "accept"
    table = ItemTable(columns=[], types=[], headers=[], box=(0, 0, 5, 5), rows=[[]] * 9)
    table.checks = TableChecks(products="differ", unlike_rows=[1, 2, 3, 4, 5, 7], sum="differs")
    result.tables = [table]
    decision = decide(result, verdicts, {None: 0.01})
    assert decision.action == "review"
    assert [reason.code for reason in decision.reasons] == ["product-differs", "sum-differs"]
    assert "rows 2, 3, 4, 5, 6, ... of" in decision.reasons[0].detail
    assert decision.reasons[0].zones == ["z1", "z2"]
    table.checks = TableChecks(products="fit", sum="fits")
    assert decide(result, verdicts, {None: 0.01}).action == "accept"
