"""Rows of characters: text has them, leaves, tiles and waves have not."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from services.arrays import Mask
from services.sheet.tracing.level_rows import count_level_rows, shows_print
from simulation.pages import own_pages


@pytest.fixture(scope="module")
def text() -> Mask:
    return np.asarray(own_pages(800, 1250)[0].image < 128)


def tiles(pitch: int, share: float) -> Mask:
    """A grid of squares of which a share is dark."""
    rng = np.random.default_rng(1)
    dark = rng.random((60, 60)) < share
    return np.asarray(np.kron(dark, np.pad(np.ones((pitch - 4, pitch - 4), bool), 2)))


def leaves() -> Mask:
    """Blobs without an order."""
    return np.asarray(gaussian_filter(np.random.default_rng(2).normal(0, 1, (600, 600)), 4) > 0.06)


def test_text_has_level_rows(text: Mask) -> None:
    found = count_level_rows(text)
    assert found.rows > 20
    assert found.share > 0.7
    assert shows_print(text)
    assert not shows_print(np.ascontiguousarray(text.T))


def test_a_few_lines_are_enough(text: Mask) -> None:
    rows = np.flatnonzero(text.any(axis=1))
    assert shows_print(text[: rows[0] + 160])


@pytest.mark.parametrize("ink", [tiles(12, 0.3), tiles(16, 0.6), leaves(), np.zeros((50, 50), bool)])
def test_what_is_no_print_has_none(ink: Mask) -> None:
    assert not shows_print(ink)


def test_waves_are_not_level(text: Mask) -> None:
    y, x = np.indices(text.shape)
    bent = text[np.clip(y + (25 * np.sin(x / 60)).astype(int), 0, len(text) - 1), x]
    assert count_level_rows(bent).share < 0.5 * count_level_rows(text).share
