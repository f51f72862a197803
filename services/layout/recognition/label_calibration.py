"""Confidences of labels that mean what they say: calibrated on pages that had no part in the model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit, softmax

from services.layout.model.layout_model import USUAL_INTERCEPT, USUAL_SLOPE, Calibration
from services.layout.recognition.page_recognition import VersionedModel
from services.layout.recognition.results import Recognition

MOST_LOG_ODDS = 12.0
"""A confidence nearer to 0 or 1 says no more than this one."""


@dataclass(frozen=True, slots=True)
class LabelCalibrationParameters:
    """Prior of the line of a class around what is usual (`USUAL_SLOPE`, `USUAL_INTERCEPT` for one sample).

    Chosen for memos and juliacon by models of 3, 5 and all samples; measured on fax sheets, rescience and real letters
    too (`docs/decisions/layout.md`, 2026-11-23).
    """

    intercept_growth: float = 0.4
    """Of the usual intercept, times the logarithm of the number of samples: lines that fit later pages best have
    intercepts of -0.8 to -0.2 by models of 3 samples, and 0.1 to 0.3 by models of 15 to 22."""
    slope_deviation: float = 0.1
    intercept_deviation: float = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutZones:
    """Confidences (N,) of the labels of zones of pages that had no part in the model, and which labels are right."""

    confidence: NDArray[np.float64]
    is_right: NDArray[np.bool_]


def judge_labels(
    conditional: NDArray[np.float64], chosen: NDArray[np.intp], true: NDArray[np.intp]
) -> HeldOutZones:
    """Zones of one held-out page, from the costs (N, L) of every label given the others'."""
    among = softmax(-conditional, axis=1)
    return HeldOutZones(among[np.arange(len(chosen)), chosen], chosen == true)


def calibrate_labels(calibration: Calibration, pages: Sequence[HeldOutZones], samples: int) -> Calibration:
    """The calibration with the line of log odds that makes the labels of held-out pages most probable.

    Platt's scaling with a normal prior: log odds of being right are a line of the log odds of the softmax. `samples` is
    the number of those that the model is made of.
    """
    p = LabelCalibrationParameters()
    if not pages:
        return calibration
    log_odds = _log_odds(np.concatenate([page.confidence for page in pages]))
    is_right = np.concatenate([page.is_right for page in pages])
    usual = np.array([USUAL_SLOPE, USUAL_INTERCEPT + p.intercept_growth * np.log(samples)])
    deviation = np.array([p.slope_deviation, p.intercept_deviation])

    def cost(line: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        found = line[0] * log_odds + line[1]
        away = (line - usual) / deviation
        error = expit(found) - is_right
        value = np.sum(np.logaddexp(0.0, found) - is_right * found) + 0.5 * away @ away
        return float(value), np.array([error @ log_odds, error.sum()]) + away / deviation

    slope, intercept = minimize(cost, usual, jac=True, bounds=[(0.05, 3.0), (-6.0, 6.0)]).x
    return replace(
        calibration,
        label_slope=float(slope),
        label_intercept=float(intercept),
        label_zones=len(log_odds),
    )


def with_believable_labels(recognition: Recognition, models: Sequence[VersionedModel]) -> Recognition:
    """The recognition with calibrated confidences, by the model that gave the labels."""
    named = recognition.chosen or next(iter(recognition.classes), None)
    model = next((each.model for each in models if named is not None and each.model.name == named.name), None)
    if model is None:
        return recognition
    line = model.calibration
    sure = np.array([each.confidence for each in recognition.zones])
    believed = expit(line.label_slope * _log_odds(sure) + line.label_intercept)
    zones = (
        replace(each, confidence=float(confidence))
        for each, confidence in zip(recognition.zones, believed, strict=True)
    )
    return replace(recognition, zones=tuple(zones))


def _log_odds(confidence: NDArray[np.float64]) -> NDArray[np.float64]:
    least = 1.0 / (1.0 + np.exp(MOST_LOG_ODDS))
    bounded = np.clip(confidence, least, 1.0 - least)
    return np.asarray(np.log(bounded) - np.log1p(-bounded))
