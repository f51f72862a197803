"""Means, medians and quantiles: of a few values to the last bit NumPy's, whose calls take up to ten times as long, and
percentiles of many values in single precision."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Vector


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


def percentile(values: NDArray[Any], percent: float) -> NDArray[Any]:
    """As `np.percentile` (...) of values (..., N) along the last axis, N >= 1, none of them NaN, in their precision.

    NumPy looks for four of the values, the least and the largest among them: twice the time.
    """
    last = values.shape[-1] - 1
    place = last * (percent / 100)
    below = min(int(place), last)
    parted, part = np.partition(values, below, axis=-1), place - below
    low = parted[..., below]
    high = parted[..., below + 1 :].min(axis=-1) if below < last else low
    step = high - low
    return np.asarray(high - step * (1 - part) if part >= 0.5 else low + step * part)


def percentile_of_sorted(ordered: NDArray[np.float32] | Vector, percent: float) -> NDArray[Any]:
    """Percentile (...) of values (..., K) in ascending order, linear between them as `np.percentile`'s.

    For several percentiles of one row, sorting takes as long as the partitions of `np.percentile`, or less.
    """
    below, part = _place(ordered.shape[-1], percent)
    low, high = ordered[..., below], ordered[..., min(below + 1, ordered.shape[-1] - 1)]
    return np.asarray(low + (high - low) * part)


def high_percentile(values: NDArray[np.float32] | Vector, percent: float) -> NDArray[Any]:
    """As `percentile_of_sorted` (...) of values (..., K) in any order, for a percentile near 100.

    A partition of 300 000 values takes a fifth of the time of sorting them, and few are left above it.
    """
    below, part = _place(values.shape[-1], percent)
    parted = np.partition(values, below, axis=-1)
    low = parted[..., below]
    high = parted[..., below + 1 :].min(axis=-1, initial=np.float32(np.inf))
    return np.asarray(low if part == 0 else low + (high - low) * part)


def _place(count: int, percent: float) -> tuple[int, np.float32]:
    """Rank of the value at or below a percentile of `count` values, and the part of the step to the next one."""
    place = percent / 100 * (count - 1)
    return int(place), np.float32(place - int(place))
