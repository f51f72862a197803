"""Print in cells of the page by kernels beside their plain versions: the same bits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.kernels.library import find_kernels
from services.mosaic.composition.related_cells import (
    masked_means,
    masked_means_plain,
    masked_medians,
    masked_medians_plain,
    raise_strength,
    raise_strength_plain,
    relate_cells,
    relate_cells_plain,
    remove_noise,
)

pytestmark = pytest.mark.skipif(find_kernels() is None, reason="needs kernels, which a C compiler makes")
SIDES, SEEDS = st.integers(1, 70), st.integers(0, 2**32 - 1)


@given(SIDES, SIDES, SEEDS)
def test_cells_relative_to_paper(rows: int, columns: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    gray = rng.integers(0, 256, (rows, columns), np.uint8)
    energy = rng.exponential(20.0, (rows, columns, 2)).astype(np.float32)
    shown = rng.random((rows, columns)) > 0.3
    weight = np.maximum(rng.normal(0.5, 0.4, (rows, columns)), 0).astype(np.float32)
    light = (weight * rng.uniform(0, 255, (rows, columns))).astype(np.float32)
    found = relate_cells(gray, energy, shown, light, weight, 0.95)
    plain = relate_cells_plain(gray, energy, shown, light, weight, 0.95)
    for name in ("darkness", "slope", "energy", "bare"):
        assert np.array_equal(getattr(found, name), getattr(plain, name)), name
    noise = np.array([0.01, 0.3], np.float32)
    quiet = np.maximum(plain.energy - noise, 0)
    remove_noise(found.energy, noise)
    assert np.array_equal(found.energy, quiet)


@given(SIDES, SIDES, SEEDS)
def test_strength(rows: int, columns: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(0.3, 0.5, (rows, columns)).astype(np.float32)
    largest = (values + rng.exponential(0.2, (rows, columns))).astype(np.float32)
    strength = rng.integers(0, 200, (rows, columns), np.uint8)
    plain = strength.copy()
    raise_strength(values, largest, 0.1, 0.25, strength)
    raise_strength_plain(values, largest, 0.1, 0.25, plain)
    assert np.array_equal(strength, plain)


@given(SIDES, SIDES, SEEDS, st.sampled_from([0.0, 0.1, 0.9, 1.0]), st.booleans())
def test_medians_and_means(rows: int, columns: int, seed: int, share: float, equal: bool) -> None:
    rng = np.random.default_rng(seed)
    values = rng.exponential(1.0, (rows, columns, 2)).astype(np.float32)
    if equal:
        values = np.round(values * 2) / 2
    mask = rng.random((rows, columns)) < share
    assert np.array_equal(masked_medians(values, mask), masked_medians_plain(values, mask))
    assert np.array_equal(masked_means(values, mask), masked_means_plain(values, mask))


def test_other_cells_are_refused() -> None:
    cells = np.zeros((4, 5), np.float32)
    with pytest.raises(ValueError, match="same cells"):
        masked_medians(np.zeros((4, 5, 2), np.float32), np.zeros((5, 4), bool))
    with pytest.raises(ValueError, match="same cells"):
        relate_cells(
            np.zeros((4, 4), np.uint8), np.zeros((4, 5, 2), np.float32), cells > 0, cells, cells, 0.9
        )
    with pytest.raises(ValueError, match="same cells"):
        raise_strength(cells, cells, 0.1, 0.2, np.zeros((5, 5), np.uint8))
