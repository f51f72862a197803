"""Order statistics of a few values are NumPy's, to the last bit; percentiles of many in single precision nearly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.order_statistics import (
    high_percentile,
    higher_quantile,
    mean,
    median,
    percentile,
    percentile_of_sorted,
    quantile,
)

VALUES = st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=30).map(np.array)


@settings(max_examples=60, deadline=None)
@given(VALUES, st.one_of(st.sampled_from([0.0, 0.4, 0.6, 0.88, 1.0]), st.floats(0, 1)))
def test_they_are_those_of_numpy(values: np.ndarray, share: float) -> None:
    assert mean(values) == np.mean(values)
    assert median(values) == np.median(values)
    assert quantile(values, share) == np.quantile(values, share)
    assert higher_quantile(values, share) == np.quantile(values, share, method="higher")
    assert median(np.round(values).astype(np.float32)) == np.median(np.round(values).astype(np.float32))


@pytest.mark.parametrize("count", [1, 2, 57, 2116])
def test_percentiles_of_rows_are_numpys(count: int) -> None:
    rows = np.random.default_rng(count).normal(100, 40, (9, count)).astype(np.float32)
    for percent in (0.0, 3.0, 50.0, 98.0, 100.0):
        expected = np.percentile(rows, percent, axis=1)
        assert np.allclose(percentile_of_sorted(np.sort(rows, axis=1), percent), expected, rtol=1e-5)
        assert np.allclose(high_percentile(rows, percent), expected, rtol=1e-5)


@pytest.mark.parametrize("count", [1, 2, 3, 57, 2116])
@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_a_percentile_is_numpys_to_the_last_bit(count: int, precision: type) -> None:
    rows = np.random.default_rng(count).normal(100, 40, (9, count)).astype(precision)
    for percent in (0, 1, 2.5, 30.0, 50.0, 80, 97.0, 99, 100):
        found, expected = percentile(rows, percent), np.percentile(rows, percent, axis=1)
        assert found.dtype == expected.dtype
        assert np.array_equal(found, expected)
        assert percentile(rows[0], percent) == np.percentile(rows[0], percent)
