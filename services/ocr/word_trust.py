"""Confidences of read words that mean what they say: the probability that the word is right.

Tesseract's own are too low where it is sure and too high where it is not: 99.8 % of words at 0.96 to 0.97 are right,
but a third of those at 0.3 to 0.6. Beta calibration (Kull, Silva Filho and Flach 2017) has a term for each end. The
coefficients are learned by `python -m benchmarks text_confidence`.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.ocr.engine import CERTAIN

LEAST, LARGEST = 0.01, 0.985
"""Confidences are bounded to this range, beyond which there were no words to learn from."""


@dataclass(frozen=True, slots=True)
class WordTrust:
    """logit p = `constant` + `of_confidence` ln c - `of_doubt` ln(1 - c)."""

    constant: float = -2.12
    of_confidence: float = 0.18
    of_doubt: float = 2.25


_SHIPPED = WordTrust()


def features_of(confidence: float) -> tuple[float, float, float]:
    """The variables of the calibration's logit: 1, ln c, -ln(1 - c)."""
    c = min(max(confidence, LEAST), LARGEST)
    return 1.0, math.log(c), -math.log(1.0 - c)


def probability_right(confidence: float, trust: WordTrust | None = None) -> float:
    """Probability, 0-1, that a word of the engine's `confidence` is right."""
    if trust is None and confidence >= CERTAIN:
        return 1.0
    t = trust or _SHIPPED
    one, sure, doubt = features_of(confidence)
    logit = t.constant * one + t.of_confidence * sure + t.of_doubt * doubt
    return 1.0 / (1.0 + math.exp(-logit))


def confidence_for(probability: float) -> float:
    """The engine's confidence, 0-1, of a word that is right with this probability: words of another reader have it."""
    return float(np.interp(probability, *_probabilities()))


@functools.cache
def _probabilities() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rising probabilities (N,) and their confidences (N,)."""
    confidences = np.linspace(LEAST, LARGEST, 196)
    return np.array([probability_right(each) for each in confidences]), confidences
