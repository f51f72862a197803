"""Which samples are held out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.layout.model.held_out import choose_evenly


@pytest.mark.parametrize(
    ("samples", "most", "most_work", "expected"),
    [
        (3, 5, 100.0, [0, 1, 2]),
        (9, 3, 100.0, [0, 4, 8]),
        (9, 9, 3.0, [0, 4, 8]),
        (9, 9, 0.5, [0]),
        (1, 9, 0.0, [0]),
    ],
)
def test_samples_are_spread_evenly(samples: int, most: int, most_work: float, expected: list[int]) -> None:
    assert choose_evenly([1.0] * samples, most, most_work).tolist() == expected


@given(
    st.lists(st.floats(0, 1e9), min_size=1, max_size=60),
    st.integers(1, 50),
    st.floats(0, 1e10),
)
def test_the_work_is_bounded(work: list[float], most: int, most_work: float) -> None:
    chosen = choose_evenly(work, most, most_work)
    assert 1 <= len(chosen) <= most
    assert np.all(np.diff(chosen) > 0)
    assert len(chosen) == 1 or np.asarray(work)[chosen].sum() <= most_work
