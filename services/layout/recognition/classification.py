"""Document classification: comparison of least costs of different models, and pages that fit no class (5.6.1)."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, softmax

from services.layout.model.layout_model import Calibration

USUAL_MEAN = -5.5
"""Prior mean of a class's cost a zone, between letters and title pages."""
USUAL_DEVIATION = 0.8
USUAL_WEIGHT = 0.5
"""Number of pages that the prior counts as."""
SHARE_OF_MEAN = 0.4
"""Share of a class's mean cost that is subtracted: pages of homogeneous classes have lower costs."""
SHARPNESS = 3.0
"""Log odds of two classes for each unit of cost a zone; the likelihood of held-out pages is largest at 2 to 6."""
LEAST_FIT = 0.56
"""A page fits a class when its cost is this share of the class's mean. A missing class costs the user more than a
class that is nearly right: of pages by models of their class 97 to 99 % are above from five samples on, of pages of
classes that no model was made of 80 to 90 % below."""
_LESS_BY_ZONES = 0.153
"""By so much `least_fit` falls for each unit of the logarithm of the number of zones: the mean of many costs tells
more. Learned by a logistic regression on the nearest classes of pages with and without their own class among the
models (`docs/decisions/layout-classes.md`, 2026-11-24)."""
_ZONES_BETWEEN = (20, 40)
"""Pages of fewer or more zones count as these; `least_fit` is that of 20."""
FIT_SHARPNESS = 15.0
"""Log odds of fitting for each unit of that share."""


MOST_LOG_ODDS = 300.0
"""Limit of log odds, below the overflow of the exponential."""


def calibrate(costs_per_zone: Sequence[float]) -> Calibration:
    """Mean and deviation of the costs of held-out pages of a class, combined with the prior."""

    costs, weight = np.asarray(costs_per_zone, dtype=np.float64), USUAL_WEIGHT
    mean = (costs.sum() + weight * USUAL_MEAN) / (len(costs) + weight)
    squares = ((costs - mean) ** 2).sum() + 2 * USUAL_DEVIATION**2
    return Calibration(float(mean), float(np.sqrt(squares / (len(costs) + 2))), len(costs))


def class_evidence(
    costs_per_zone: NDArray[np.float64], calibrations: Sequence[Calibration]
) -> NDArray[np.float64]:
    """Log likelihood ratios (M,) of the classes for a page; 0: as likely as a page of any kind.

    `costs_per_zone` (M,) are least costs by the usual weights of attributes, which all models share, over the
    number of zones: they are log likelihood ratios against a page of any kind, so that a model of many components
    has no advantage over one of few. M >= 1.
    """
    means = np.array([calibration.mean for calibration in calibrations])
    costs_per_zone = costs_per_zone + [calibration.bias for calibration in calibrations]
    return np.asarray(-SHARPNESS * excess_costs(costs_per_zone, means))


def least_fit(zones: int) -> float:
    """Share of a class's mean cost from which on a page of `zones` zones belongs to the class rather than to none."""

    fewest, most = _ZONES_BETWEEN
    return LEAST_FIT - _LESS_BY_ZONES * math.log(min(max(zones, fewest), most) / fewest)


def log_odds_of_fit(cost_per_zone: float, calibration: Calibration, zones: int) -> float:
    """Log odds that a page of `zones` zones belongs to a class rather than to none, from its cost over the mean one."""
    fit = (cost_per_zone + calibration.bias) / min(calibration.mean, -1.0)
    odds = FIT_SHARPNESS * (fit - least_fit(zones))
    # Bounded, so that the nearest class always has a higher probability than the others.
    return float(np.clip(odds, -MOST_LOG_ODDS, MOST_LOG_ODDS))


def classify(
    costs_per_zone: NDArray[np.float64], calibrations: Sequence[Calibration], zones: int
) -> tuple[NDArray[np.float64], float]:
    """Probabilities (M,) of the classes and that of none of them, which sum to 1, for a page of `zones` zones.

    Costs as in `class_evidence`.
    """
    among = softmax(class_evidence(costs_per_zone, calibrations))
    best = int(np.argmax(among))
    odds = log_odds_of_fit(float(costs_per_zone[best]), calibrations[best], zones)
    return np.asarray(expit(odds) * among), float(expit(-odds))


def excess_costs(costs_per_zone: NDArray[np.float64], means: NDArray[np.float64]) -> NDArray[np.float64]:
    """Costs a zone (M,) minus a share of the class's mean cost. The least one is the best class."""
    return np.asarray(costs_per_zone - SHARE_OF_MEAN * means)
