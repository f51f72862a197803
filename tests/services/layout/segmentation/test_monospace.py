"""Cells of monospaced print are found to the hundredth of their width; other print has none."""

from itertools import pairwise

import numpy as np
import pytest

from services.layout.segmentation.components import Boxes
from services.layout.segmentation.monospace import cell_widths
from services.layout.segmentation.operators import links_across

HEIGHT = 10.0


def row(centres: np.ndarray, y: float, rng: np.random.Generator) -> Boxes:
    """Glyphs of many widths round `centres`, which are whole pixels as components are."""
    half = rng.uniform(0.15, 0.4, len(centres)) * HEIGHT
    left, right = np.round(centres - half), np.round(centres + half)
    return np.column_stack([left, np.full_like(left, y), right, np.full_like(left, y + HEIGHT)])


def in_cells(width: float, count: int, y: float, rng: np.random.Generator) -> Boxes:
    """A row of `count` characters in cells, a fifth of which are blank."""
    places = np.flatnonzero(rng.random(count) < 0.8)
    return row(100 + (places + 0.5) * width, y, rng)


def widths_of(*rows: Boxes) -> np.ndarray:
    starts = np.cumsum([0, *map(len, rows)])
    members = [np.arange(a, b) for a, b in pairwise(starts)]
    return cell_widths(np.concatenate(rows), members)


@pytest.mark.parametrize("width", [7.3, 9.81, 12.6])
def test_the_cell_of_a_row_is_found(width: float) -> None:
    rng = np.random.default_rng(1)
    for count in (25, 60):
        assert widths_of(in_cells(width, count, 0, rng)) == pytest.approx(width, rel=0.01)


def test_print_of_other_widths_has_no_cells() -> None:
    rng = np.random.default_rng(2)
    rows = [
        row(100 + np.cumsum(rng.uniform(0.3, 1.1, count) * HEIGHT), 0, rng)
        for count in np.tile((9, 15, 30, 60), 50)
    ]
    found = np.concatenate([widths_of(each) for each in rows])
    assert np.mean(found > 0) <= 0.02


def test_a_short_row_has_the_cells_of_the_rows_around() -> None:
    rng = np.random.default_rng(3)
    full = in_cells(9.8, 50, 0, rng)
    short = row(100 + 9.8 * np.array([4.5, 6.5, 7.5]), 16, rng)
    between = row(100 + 9.8 * np.array([4.5, 7.0, 8.9]), 16, rng)
    far = row(100 + 9.8 * np.array([4.5, 6.5, 7.5]), 160, rng)
    assert widths_of(full, short) == pytest.approx(9.8, rel=0.01)
    assert widths_of(full, between)[1] == 0
    assert widths_of(full, far)[1] == 0


def test_an_operator_links_the_words_on_both_sides_and_no_others() -> None:
    words = np.array(
        [
            [0, 0, 30, 10],
            [70, 0, 99, 10],
            [110, 0, 150, 10],
            [70, 40, 99, 50],
            [0, 80, 30, 90],
            [70, 70, 99, 100],
        ],
        float,
    )
    equals = np.array([[45, 3, 53, 4], [45, 6, 53, 7]], float)
    left, right = links_across(equals, words)
    assert set(zip(left.tolist(), right.tolist(), strict=True)) == {(0, 1)}
    between_sizes = np.array([[45, 84, 53, 85]], float)
    assert links_across(between_sizes, words)[0].size == 0
    assert links_across(np.empty((0, 4)), words)[0].size == 0
