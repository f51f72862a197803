"""The map itself: sampling, and what it does to colours."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.mosaic.light.tones import ToneMap, apply_tones, tone_factors
from tests.services.mosaic.cuttings import identity_tones


def test_identity_changes_nothing() -> None:
    tile = np.random.default_rng(1).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    x, y = np.meshgrid(np.arange(30.0), np.arange(20.0))
    coefficients = identity_tones(300, 200).at(np.stack([x, y], axis=-1).reshape(-1, 2)).reshape(20, 30, 6)
    assert np.array_equal(apply_tones(tile, tone_factors(coefficients)), tile)


@settings(max_examples=30, deadline=None)
@given(rows=st.integers(1, 7), columns=st.integers(1, 7), seed=st.integers(0, 99))
def test_a_linear_field_is_sampled_exactly_between_its_outermost_cells(
    rows: int, columns: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    width, height = 90, 60
    x = (np.arange(columns) + 0.5) * width / columns - 0.5
    y = (np.arange(rows) + 0.5) * height / rows - 0.5
    a, b, c = rng.normal(size=(3, 6))
    values = a + b * x[None, :, None] + c * y[:, None, None]
    tones = ToneMap(values.astype(np.float32), width, height)
    points = rng.uniform((-20, -20), (width + 20, height + 20), (40, 2))
    within = np.clip(points, (x[0], y[0]), (x[-1], y[-1]))
    expected = a + b * within[:, :1] + c * within[:, 1:]
    assert tones.at(points) == pytest.approx(expected, abs=1e-3)


def test_levels_come_after_the_gains_and_by_the_strongest_channel() -> None:
    tile = np.array([[[100, 50, 20]]], np.uint8)
    coefficients = np.array([[[0.5, 2.0, 1.0, 1.2, 0.3, -10.0]]], np.float32)
    # Balanced 50, 100, 20: the strongest is 100; plus 0.3 * 100 - 10.
    assert apply_tones(tile, tone_factors(coefficients))[0, 0].tolist() == [80, 140, 44]


def test_results_are_clipped() -> None:
    tile = np.array([[[100, 100, 100]]], np.uint8)
    bright, dark = (
        tone_factors(np.array([[coefficients]], np.float32))
        for coefficients in ((9, 1, 1, 1, 0, -50), (1, 1, 1, 1, 0, -150))
    )
    assert apply_tones(tile, bright)[0, 0].tolist() == [255, 50, 50]
    assert apply_tones(tile, dark)[0, 0].tolist() == [0, 0, 0]
