"""Confidences of read words that mean what they say: the probability that the word is right.

Tesseract's own are too low where it is sure and too high where it is not: 99.8 % of words at 0.96 to 0.97 are right,
but a third of those at 0.3 to 0.6. Beta calibration (Kull, Silva Filho and Flach 2017) has a term for each end. The
coefficients are learned by `python -m benchmarks text_confidence`.
"""

import math
from dataclasses import dataclass

LEAST, LARGEST = 0.01, 0.985
"""Confidences are bounded to this range, beyond which there were no words to learn from."""


@dataclass(frozen=True, slots=True)
class WordTrust:
    """logit p = `constant` + `of_confidence` ln c - `of_doubt` ln(1 - c)."""

    constant: float = -2.12
    of_confidence: float = 0.18
    of_doubt: float = 2.25


def features_of(confidence: float) -> tuple[float, float, float]:
    """The variables of the calibration's logit: 1, ln c, -ln(1 - c)."""
    c = min(max(confidence, LEAST), LARGEST)
    return 1.0, math.log(c), -math.log(1.0 - c)


def probability_right(confidence: float, trust: WordTrust | None = None) -> float:
    """Probability, 0-1, that a word of the engine's `confidence` is right."""
    t = trust or _SHIPPED
    one, sure, doubt = features_of(confidence)
    logit = t.constant * one + t.of_confidence * sure + t.of_doubt * doubt
    return 1.0 / (1.0 + math.exp(-logit))


_SHIPPED = WordTrust()
