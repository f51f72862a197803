"""Means, medians and quantiles of a few values: to the last bit NumPy's, whose calls take up to ten times as long."""

import math

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats


def mean(values: NDArray[np.float64]) -> float:
    """As `np.mean` of values (N,), N >= 1."""
    return float(values.sum()) / len(values)


_FEW = 500
"""Up to so many values, sorting them all takes less time than NumPy's call."""


def median(values: Floats) -> float:
    """As `np.median` of values (N,), N >= 1: NaN where one of them is."""
    count = len(values)
    if count > _FEW:
        return float(np.median(values))
    ordered = np.sort(values)
    low, high = float(ordered[(count - 1) // 2]), float(ordered[count // 2])
    if math.isnan(ordered[-1]):
        return math.nan
    return low if count % 2 else (low + high) / 2


def median_along(values: Floats, axis: int) -> Floats:
    """As `np.median` of values of any shape along `axis`, none of them NaN; for few values along it."""
    ordered, count = np.sort(values, axis=axis), values.shape[axis]
    middle = ordered.take([(count - 1) // 2, count // 2], axis=axis)
    return np.asarray(middle.mean(axis=axis))


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
