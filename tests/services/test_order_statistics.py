"""Order statistics of a few values are NumPy's, to the last bit."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from services.order_statistics import higher_quantile, mean, median, quantile

VALUES = st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=30).map(np.array)


@settings(max_examples=60, deadline=None)
@given(VALUES, st.one_of(st.sampled_from([0.0, 0.4, 0.6, 0.88, 1.0]), st.floats(0, 1)))
def test_they_are_those_of_numpy(values: np.ndarray, share: float) -> None:
    assert mean(values) == np.mean(values)
    assert median(values) == np.median(values)
    assert quantile(values, share) == np.quantile(values, share)
    assert higher_quantile(values, share) == np.quantile(values, share, method="higher")
    assert median(np.round(values).astype(np.float32)) == np.median(np.round(values).astype(np.float32))
