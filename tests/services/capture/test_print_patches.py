"""Percentiles of sorted rows: against numpy's."""

import numpy as np
import pytest

from services.capture.print_patches import percentile_of_sorted


@pytest.mark.parametrize("count", [1, 2, 57, 2116])
def test_percentiles_of_sorted_rows_are_numpys(count: int) -> None:
    rows = np.random.default_rng(count).normal(100, 40, (9, count)).astype(np.float32)
    for percent in (0.0, 3.0, 50.0, 98.0, 100.0):
        found = percentile_of_sorted(np.sort(rows, axis=1), percent)
        assert np.allclose(found, np.percentile(rows, percent, axis=1), rtol=1e-5)
