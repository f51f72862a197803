"""Document classification: least costs of different models made comparable, and pages that fit none (5.6.1)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, softmax

from services.layout.model.layout_model import Calibration

MOST_LOG_ODDS = 300.0
"""Of fitting and of not: the exponential of more is soon no number."""


@dataclass(frozen=True, slots=True)
class ClassificationParameters:
    """Measured on title pages, letters, memos and fax sheets by models of 1, 3 and all samples."""

    usual_mean: float = -5.5
    """Cost a zone that is assumed of a class before pages of it were held out; between letters and title pages."""
    usual_deviation: float = 0.8
    usual_weight: float = 0.5
    """Pages that the assumption counts as."""
    share_of_mean: float = 0.4
    """How far the mean cost of a class is taken off: strict classes have low costs, their pages lower ones."""
    sharpness: float = 3.0
    """Log odds of two classes for each unit of cost a zone; the likelihood of held-out pages is largest at 2 to 6."""
    least_fit: float = 0.55
    """A page fits a class when its cost is this share of the class's mean. Of title pages and letters 98 % have 0.63
    or more by models of their class from eight samples on, of pages of classes that no model was made of 90 % less
    than 0.56. A class that is withheld costs its user more than one that is nearly right."""
    fit_sharpness: float = 15.0
    """Log odds of fitting for each unit of that share."""


def calibrate(
    costs_per_zone: Sequence[float], parameters: ClassificationParameters = ClassificationParameters()
) -> Calibration:
    """Mean and deviation of the costs of held-out pages of a class, drawn to the usual ones."""
    costs, weight = np.asarray(costs_per_zone, dtype=np.float64), parameters.usual_weight
    mean = (costs.sum() + weight * parameters.usual_mean) / (len(costs) + weight)
    squares = ((costs - mean) ** 2).sum() + 2 * parameters.usual_deviation**2
    return Calibration(float(mean), float(np.sqrt(squares / (len(costs) + 2))), len(costs))


def class_evidence(
    costs_per_zone: NDArray[np.float64],
    calibrations: Sequence[Calibration],
    parameters: ClassificationParameters = ClassificationParameters(),
) -> NDArray[np.float64]:
    """Log likelihoods (M,) of a page by the classes, up to what they share; 0: as likely as by any kind of page.

    `costs_per_zone` (M,) are least costs by the usual weights of attributes, which all models share, over the
    number of zones: they are log likelihood ratios against a page of any kind, so that a model of many components
    has no advantage over one of few. M >= 1.
    """
    means = np.array([calibration.mean for calibration in calibrations])
    costs_per_zone = costs_per_zone + [calibration.bias for calibration in calibrations]
    return np.asarray(-parameters.sharpness * excess_costs(costs_per_zone, means, parameters))


def log_odds_of_fit(
    cost_per_zone: float,
    calibration: Calibration,
    parameters: ClassificationParameters = ClassificationParameters(),
) -> float:
    """Log odds of a page being of a class rather than of none, by the share of the class's mean that its cost is."""
    fit = (cost_per_zone + calibration.bias) / min(calibration.mean, -1.0)
    # Bounded, so that the nearest class keeps a probability above the others' however bad it is.
    odds = np.clip(parameters.fit_sharpness * (fit - parameters.least_fit), -MOST_LOG_ODDS, MOST_LOG_ODDS)
    return float(odds)


def classify(
    costs_per_zone: NDArray[np.float64],
    calibrations: Sequence[Calibration],
    parameters: ClassificationParameters = ClassificationParameters(),
) -> tuple[NDArray[np.float64], float]:
    """Probabilities (M,) of the classes and that of none of them, which sum to 1; costs as in `class_evidence`."""
    among = softmax(class_evidence(costs_per_zone, calibrations, parameters))
    best = int(np.argmax(among))
    odds = log_odds_of_fit(float(costs_per_zone[best]), calibrations[best], parameters)
    return np.asarray(expit(odds) * among), float(expit(-odds))


def excess_costs(
    costs_per_zone: NDArray[np.float64],
    means: NDArray[np.float64],
    parameters: ClassificationParameters = ClassificationParameters(),
) -> NDArray[np.float64]:
    """Costs a zone (M,) as classes are compared by them: less the share of the class's mean cost; least is best."""
    return np.asarray(costs_per_zone - parameters.share_of_mean * means)
