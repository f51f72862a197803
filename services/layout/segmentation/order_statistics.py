"""Means, medians and quantiles of a few values: to the last bit NumPy's, whose calls take up to ten times as long."""

import math

import numpy as np
from numpy.typing import NDArray


def mean(values: NDArray[np.float64]) -> float:
    """As `np.mean` of values (N,), N >= 1."""
    return float(values.sum()) / len(values)


def median(values: NDArray[np.float64]) -> float:
    """As `np.median` of values (N,), N >= 1, none of them NaN."""
    ordered, count = np.sort(values), len(values)
    low, high = float(ordered[(count - 1) // 2]), float(ordered[count // 2])
    return low if count % 2 else (low + high) / 2


def quantile(values: NDArray[np.float64], share: float) -> float:
    """As `np.quantile` of values (N,), N >= 1, none of them NaN, by linear interpolation."""
    ordered = np.sort(values)
    place = (len(values) - 1) * share
    below = math.floor(place)
    low, high = float(ordered[below]), float(ordered[min(below + 1, len(values) - 1)])
    part, step = place - below, high - low
    return high - step * (1 - part) if part >= 0.5 else low + step * part


def higher_quantile(values: NDArray[np.float64], share: float) -> float:
    """As `np.quantile` with method "higher": one of the values (N,), N >= 1."""
    return float(np.sort(values)[math.ceil((len(values) - 1) * share)])
