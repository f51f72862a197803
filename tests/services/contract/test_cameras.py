"""The robust mean of what a camera's pages have shown."""

import math

import numpy as np
import pytest

from services.contract.cameras import LEAST_DEVIATION, remember


def test_the_mean_weighs_by_precision() -> None:
    memory = remember("a", [(1.0, 0.01), (1.1, 0.1), (0.98, 0.1)])
    assert (memory.name, memory.photos) == ("a", 3)
    assert memory.log_focal == pytest.approx(1.0, abs=0.01)


def test_a_zoomed_photo_does_not_count() -> None:
    seen = [(0.5 + 0.01 * k, 0.03) for k in range(-3, 4)]
    memory = remember("a", [*seen, (0.5 + math.log(2), 0.03)])
    assert memory.log_focal == pytest.approx(0.5, abs=0.01)


def test_the_deviation_is_that_of_the_mean() -> None:
    rng = np.random.default_rng(5)
    errors, stated = [], []
    for _ in range(200):
        memory = remember("a", [(float(rng.normal(0.3, 0.05)), 0.05) for _ in range(10)])
        errors.append(memory.log_focal - 0.3)
        stated.append(memory.deviation)
    assert np.std(errors) == pytest.approx(np.mean(stated), rel=0.3)
    assert remember("a", [(0.3, 0.001)] * 24).deviation == LEAST_DEVIATION
