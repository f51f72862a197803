"""Learning from a verified class: the mean cost of its pages, and a bias when the decision was wrong or close."""

from dataclasses import replace

import numpy as np

from services.layout.learning.statistics_update import MOST_PAGES
from services.layout.model.layout_model import Calibration
from services.layout.recognition.classification import (
    FIT_SHARPNESS,
    SHARE_OF_MEAN,
    SHARPNESS,
    USUAL_DEVIATION,
    USUAL_MEAN,
    USUAL_WEIGHT,
    least_fit,
)

MOST_STEP = 0.5
"""Largest change of a bias by one page, in cost a zone. It is 1.5 log odds, so that no single page changes a class
much."""


def count_cost(calibration: Calibration, cost_per_zone: float) -> Calibration:
    """The calibration after one more page, which the model has not learned from; like `calibrate` with all pages."""

    weight, mean, pages = USUAL_WEIGHT, calibration.mean, calibration.pages
    total = mean * (pages + weight) - weight * USUAL_MEAN
    assumed = 2 * USUAL_DEVIATION**2
    squares = calibration.deviation**2 * (pages + 2) - assumed + 2 * mean * total - pages * mean**2
    kept = min(1.0, (MOST_PAGES - 1) / max(1, pages))
    total, squares, counted = (
        kept * total + cost_per_zone,
        kept * squares + cost_per_zone**2,
        kept * pages + 1,
    )
    mean = (total + weight * USUAL_MEAN) / (counted + weight)
    spread = max(0.0, squares - 2 * mean * total + counted * mean**2)
    deviation = float(np.sqrt((spread + assumed) / (counted + 2)))
    return replace(calibration, mean=mean, deviation=deviation, pages=pages + 1)


def prefer_class(
    right: tuple[float, Calibration], wrong: tuple[float, Calibration]
) -> tuple[Calibration, Calibration]:
    """The calibrations of both classes, their biases changed until the right class wins by a margin; each takes half.

    Each class is given as the page's cost a zone under its model, and the calibration. It is the step of PA-I for the
    difference of the two classes' excess costs (`classification.classify`), which is linear in their biases.
    """

    loss = 1 / SHARPNESS + _excess(*right) - _excess(*wrong)
    step = min(MOST_STEP, max(0.0, loss / 2))
    return _biased(right[1], -step), _biased(wrong[1], step)


def accept_page(cost_per_zone: float, calibration: Calibration, zones: int) -> Calibration:
    """The calibration after a page of this class, of `zones` zones, was rejected: the page now fits better."""

    most = (least_fit(zones) + 1 / FIT_SHARPNESS) * min(calibration.mean, -1.0)
    loss = cost_per_zone + calibration.bias - most
    return _biased(calibration, -min(MOST_STEP, max(0.0, loss)))


def refuse_page(cost_per_zone: float, calibration: Calibration, zones: int) -> Calibration:
    """The calibration after a page of no class, of `zones` zones, was accepted for this class: it now fits worse."""

    least = (least_fit(zones) - 1 / FIT_SHARPNESS) * min(calibration.mean, -1.0)
    loss = least - cost_per_zone - calibration.bias
    return _biased(calibration, min(MOST_STEP, max(0.0, loss)))


def _excess(cost_per_zone: float, calibration: Calibration) -> float:
    return cost_per_zone + calibration.bias - SHARE_OF_MEAN * calibration.mean


def _biased(calibration: Calibration, step: float) -> Calibration:
    return replace(calibration, bias=calibration.bias + step) if step else calibration
