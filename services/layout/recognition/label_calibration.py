"""Confidences of labels that mean what they say: calibrated on pages that had no part in the model.

What labels of all classes have in common is in their evidence (`label_evidence`); a class adds a line.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from services.layout.matching import conditional_costs
from services.layout.matching.cost_tables import CostTables
from services.layout.model.layout_model import Calibration
from services.layout.recognition.label_evidence import label_evidence
from services.layout.recognition.page_recognition import VersionedModel
from services.layout.recognition.results import Recognition

_DEVIATION = 0.15
"""Of the prior, of the slope and of the intercept."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutZones:
    """Evidence (N,) of the labels of zones of pages that had no part in the model, and which labels are right."""

    evidence: NDArray[np.float64]
    is_right: NDArray[np.bool_]


def judge_labels(
    tables: CostTables, chosen: NDArray[np.intp], true: NDArray[np.intp], samples: int, *, is_read: bool
) -> HeldOutZones:
    """Zones of one held-out page, from its costs by a model of the other `samples`."""
    evidence = label_evidence(tables, chosen, conditional_costs(tables, chosen), samples, is_read=is_read)
    return HeldOutZones(evidence, chosen == true)


def calibrate_labels(calibration: Calibration, pages: Sequence[HeldOutZones]) -> Calibration:
    """The calibration with the line of evidence that makes the labels of held-out pages most probable.

    Platt's scaling with a normal prior.
    """

    if not pages:
        return calibration
    evidence = np.concatenate([page.evidence for page in pages])
    is_right = np.concatenate([page.is_right for page in pages])
    usual = np.array([1.0, 0.0])

    def cost(line: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        found = line[0] * evidence + line[1]
        away = (line - usual) / _DEVIATION
        error = expit(found) - is_right
        value = np.sum(np.logaddexp(0.0, found) - is_right * found) + 0.5 * away @ away
        return float(value), np.array([error @ evidence, error.sum()]) + away / _DEVIATION

    slope, intercept = minimize(cost, usual, jac=True, bounds=[(0.05, 3.0), (-6.0, 6.0)]).x
    return replace(
        calibration,
        evidence_slope=float(slope),
        evidence_intercept=float(intercept),
        evidence_zones=len(evidence),
    )


def with_believable_labels(recognition: Recognition, models: Sequence[VersionedModel]) -> Recognition:
    """The recognition with calibrated confidences, by the model that gave the labels."""
    named = recognition.chosen or next(iter(recognition.classes), None)
    model = next((each.model for each in models if named is not None and each.model.name == named.name), None)
    if model is None:
        return recognition
    line = model.calibration
    zones = (
        each
        if each.evidence is None
        else replace(
            each,
            confidence=float(expit(line.evidence_slope * each.evidence + line.evidence_intercept))
            * (1.0 - (each.several or 0.0)),
        )
        for each in recognition.zones
    )
    return replace(recognition, zones=tuple(zones))
