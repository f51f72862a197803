"""Which pages may go through without a person: a threshold of confidence for each class, from feedback so far.

The operator states a tolerated error: the share of accepted zones whose label or class may be wrong. The threshold of a
class is the lowest of `CANDIDATES` at which the upper confidence bound of that error (Clopper and Pearson, 1934) is at
most the tolerated one. The bounds of all candidates hold together with probability `CERTAINTY` (Bonferroni). They
presuppose that the verified zones of a class are like those to come, and that zones err independently of each other;
where errors of one page belong together the true certainty is lower. A class without a threshold is reviewed.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Literal

from app.schemas.layout import known_result
from models.records import ReviewDraft
from services.contract.answers.layout import Decision, DecisionReason, LayoutResult
from services.contract.answers.learning import Verdict
from services.contract.result_json import ResultJson

CERTAINTY = 0.95
CANDIDATES = (0.999, 0.99, 0.97, 0.9, 0.8, 0.5, 0.0)
"""Confidences among which a threshold is chosen; each one more costs evidence, ln(number) / error zones."""
_MOST_NAMED = 5
"""Rows of a table that a reason names."""
EVIDENCE = 400
"""Newest feedbacks of a class from which its threshold is computed: older ones are of older models."""


def read_tolerated_errors(text: str) -> dict[str, float]:
    """The tolerated errors of a setting by class or `class/label`; `*`: all classes. Raises ValueError."""
    shares = {"*": 0.01}
    for entry in filter(None, map(str.strip, text.split(","))):
        name, _, share = entry.rpartition("=")
        shares[name or "*"] = float(share)
    return shares


def tolerated_errors_of(name: str, shares: Mapping[str, float]) -> dict[str | None, float]:
    """Tolerated error of a class, under None, and of its labels that have one of their own."""
    prefix = f"{name}/"
    of_labels = {key.removeprefix(prefix): share for key, share in shares.items() if key.startswith(prefix)}
    errors: dict[str | None, float] = {None: shares.get(name, shares["*"])}
    errors.update(of_labels)
    return errors


def _at_most(wrong: int, total: int, rate: float) -> float:
    """Probability of `wrong` or fewer successes of a binomial distribution."""
    if rate <= 0.0 or rate >= 1.0:
        return float(rate <= 0.0)
    log_rate, log_rest = math.log(rate), math.log1p(-rate)
    terms = (
        math.lgamma(total + 1)
        - math.lgamma(k + 1)
        - math.lgamma(total - k + 1)
        + k * log_rate
        + (total - k) * log_rest
        for k in range(wrong + 1)
    )
    return min(1.0, math.fsum(math.exp(term) for term in terms))


def threshold_of(verdicts: Sequence[Verdict], tolerated: float) -> float | None:
    """Least confidence of accepted zones; None: the evidence does not allow to accept any."""
    certainty = 1.0 - (1.0 - CERTAINTY) / len(CANDIDATES)
    allowed = [candidate for candidate in CANDIDATES if _is_shown(verdicts, candidate, tolerated, certainty)]
    return min(allowed, default=None)


def _is_shown(verdicts: Sequence[Verdict], candidate: float, tolerated: float, certainty: float) -> bool:
    """Whether Clopper and Pearson's upper bound of the error above the candidate is at most the tolerated one.

    The probability of few errors falls with the rate, so one value decides it without the bound itself.
    """
    chosen = [right for _, confidence, right in verdicts if confidence >= candidate]
    wrong = chosen.count(False)
    return wrong < len(chosen) and _at_most(wrong, len(chosen), tolerated) <= 1.0 - certainty


def joint_confidences(result: LayoutResult) -> dict[str, float]:
    """Probability that class and label of each zone are right, by the zone's id; 0 without a class."""
    sure = result.class_.probability if result.class_ else 0.0
    return {zone.id: sure * zone.confidence for zone in result.zones}


def verdicts_of(
    result: LayoutResult, wrong: Collection[str], kept: Collection[str], *, class_is_right: bool
) -> list[Verdict]:
    """What a feedback says of the zones of a result, for later decisions.

    `wrong` are ids of zones with a wrong label, `kept` those of the zones that the person did not delete.
    """
    if result.class_ is None:
        return []
    confidences = joint_confidences(result)
    return [
        (
            zone.label,
            round(confidences[zone.id], 5),
            class_is_right and zone.id in kept and zone.id not in wrong,
        )
        for zone in result.zones
    ]


def decide(
    result: LayoutResult, verdicts: Sequence[Verdict], tolerated: Mapping[str | None, float]
) -> Decision:
    """Whether a page may go through.

    Parameters
    ----------
    result
        The result of the recognition.
    verdicts
        Of the class that was found.
    tolerated
        Tolerated error of the class, under None, and of labels that have one of their own.
    """
    stated = tolerated[None]
    if result.class_ is None:
        detail = "No class fits this page. Give it its class."
        reasons = [DecisionReason(code="no-class", detail=detail, zones=[])]
        return Decision(action="review", tolerated_error=stated, reasons=reasons)
    thresholds = {
        label: threshold_of(
            verdicts if label is None else [one for one in verdicts if one[0] == label], error
        )
        for label, error in tolerated.items()
    }
    confidences = joint_confidences(result)
    unknown, unsure = [], []
    for zone in result.zones:
        threshold = thresholds.get(zone.label, thresholds[None])
        if threshold is None:
            unknown.append(zone.id)
        elif confidences[zone.id] < threshold:
            unsure.append(zone.id)
    name = result.class_.name
    reasons = []
    if unknown:
        detail = f"There is too little feedback on {name} to show an error of at most {stated:g}. Confirm pages of it."
        reasons.append(DecisionReason(code="no-evidence", detail=detail, zones=unknown))
    if unsure:
        detail = f"Of zones as unsure as these, more than {stated:g} may be wrong."
        reasons.append(DecisionReason(code="unsure", detail=detail, zones=unsure))
    reasons += _unlike_numbers(result)
    action: Literal["accept", "review"] = "review" if reasons else "accept"
    return Decision(action=action, tolerated_error=stated, reasons=reasons)


def _unlike_numbers(result: LayoutResult) -> list[DecisionReason]:
    """Reasons of tables whose numbers do not say the same."""
    reasons = []
    for table in result.tables:
        zones = [zone.id for zone in result.zones if _shared_height(zone.box, table.box) > 0.5]
        if rows := table.checks.unlike_rows:
            shown = ", ".join(str(row + 1) for row in rows[:_MOST_NAMED]) + (
                ", ..." if rows[_MOST_NAMED:] else ""
            )
            detail = f"In rows {shown} of the table one number is not the product of the others, as in samples it is."
            reasons.append(
                DecisionReason(code="product-differs", detail=f"{detail} Compare them.", zones=zones)
            )
        if table.checks.sum == "differs":
            detail = "The amounts of the table add up to none that is printed below: look for a row too many or few."
            reasons.append(DecisionReason(code="sum-differs", detail=detail, zones=zones))
    return reasons


def _shared_height(box: tuple[float, ...], table: tuple[float, ...]) -> float:
    """Share of a zone that lies in a table."""
    across = min(box[2], table[2]) - max(box[0], table[0])
    down = min(box[3], table[3]) - max(box[1], table[1])
    return max(across, 0.0) * max(down, 0.0) / max(1.0, (box[2] - box[0]) * (box[3] - box[1]))


def expected_wrong_zones(confidences: Collection[float]) -> float:
    """Expected number of zones whose class or label is wrong, from their joint confidences: the gain of a page."""
    return math.fsum(1.0 - confidence for confidence in confidences)


def place_in_queue(result: LayoutResult) -> ReviewDraft:
    """What the queue is ordered by, for a result with its decision; a page without one is reviewed."""
    confidences = joint_confidences(result).values()
    return ReviewDraft(
        gain=expected_wrong_zones(confidences),
        confidence=min(confidences, default=0.0),
        class_name=result.class_.name if result.class_ else None,
        model_version=result.class_.model_version if result.class_ else None,
        zones=len(result.zones),
        decision=result.decision.action if result.decision else "review",
        has_image=result.image is not None,
    )


def place_of_stored(result: ResultJson) -> ReviewDraft:
    """The same for a result as the store keeps it; first comes what an old release has stored in another form."""
    known = known_result(result)
    if known is None:
        zones = len(result["zones"])
        return ReviewDraft(float(zones), confidence=0.0, class_name=None, zones=zones, decision="review")
    return place_in_queue(known)


def place_of_verified(result: ResultJson) -> ReviewDraft:
    """The same for a stored result that a person has verified: nothing of it is unsure."""
    return replace(place_of_stored(result), gain=0.0, confidence=1.0)
