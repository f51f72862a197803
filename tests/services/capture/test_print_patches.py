"""Percentiles of rows, sorted or not: against numpy's."""

import numpy as np
import pytest

from services.capture.print_patches import high_percentile, percentile_of_sorted


@pytest.mark.parametrize("count", [1, 2, 57, 2116])
def test_percentiles_of_rows_are_numpys(count: int) -> None:
    rows = np.random.default_rng(count).normal(100, 40, (9, count)).astype(np.float32)
    for percent in (0.0, 3.0, 50.0, 98.0, 100.0):
        expected = np.percentile(rows, percent, axis=1)
        assert np.allclose(percentile_of_sorted(np.sort(rows, axis=1), percent), expected, rtol=1e-5)
        assert np.allclose(high_percentile(rows, percent), expected, rtol=1e-5)
