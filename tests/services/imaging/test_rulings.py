"""Grids of tables are taken out of a page; other rules stay."""

import cv2
import numpy as np
import pytest

from services.imaging.rulings import _long_runs, cells_of_grids, without_grids

PAPER = 240


def page_with(levels: list[int], uprights: list[int], left: int = 100, right: int = 900) -> np.ndarray:
    """A page with level and upright rules, and a word of strokes within them."""
    page = np.full((1200, 1000), PAPER, np.uint8)
    for y in levels:
        page[y : y + 2, left:right] = 90
    for x in uprights:
        page[levels[0] : levels[-1], x : x + 2] = 90
    page[330:350, 220:224] = page[330:350, 230:234] = 20
    return page


def test_a_grid_is_taken_out_and_print_in_it_stays() -> None:
    page = page_with([300, 380, 460], [100, 500, 898])
    cleaned = without_grids(page)
    assert (cleaned[330:350, 220:224] == 20).all()
    cleaned = cleaned.copy()
    cleaned[330:350, 220:234] = PAPER
    assert (cleaned == PAPER).all()


def test_cells_lie_between_the_rules() -> None:
    (cells,) = cells_of_grids(page_with([300, 380, 460], [100, 500, 898]))
    expected = [(102, 302, 500, 380), (502, 302, 898, 380), (102, 382, 500, 460), (502, 382, 898, 460)]
    np.testing.assert_allclose(cells, expected, atol=2)


def test_a_frame_and_underlines_are_no_grid() -> None:
    for levels, uprights in (([300, 460], [100, 898]), ([300, 340, 380], []), ([300], [100, 500, 898])):
        page = page_with(levels, uprights)
        assert without_grids(page) is page
        assert cells_of_grids(page) == []


def with_head(page: np.ndarray) -> np.ndarray:
    """The page with a dark band over rows 380 to 460 that has light strokes."""
    page[380:460, 100:900] = 60
    for x in (300, 330, 700):
        page[405:435, x : x + 12] = PAPER
    return page


def test_a_dark_band_with_light_print_is_no_grid() -> None:
    page = with_head(np.full((1200, 1000), PAPER, np.uint8))
    assert without_grids(page) is page
    assert cells_of_grids(page) == []


def test_light_print_in_the_dark_head_of_a_grid_stays() -> None:
    page = with_head(page_with([380, 460, 540, 620], [100, 500, 898]))
    cleaned = without_grids(page)
    assert (cleaned[470:] == PAPER).all()
    assert np.array_equal(cleaned[385:455, 105:490], page[385:455, 105:490])


@pytest.mark.parametrize("length", [8, 21, 30])
@pytest.mark.parametrize("down", [False, True])
def test_long_runs_are_those_of_an_opening(length: int, down: bool) -> None:
    rng = np.random.default_rng(length)
    dark = np.zeros((150, 140), np.uint8)
    for _ in range(60):
        x, y, reach = rng.integers(0, 150), rng.integers(0, 150), rng.integers(2, 60)
        dark[y : y + 1, x : x + reach] = dark[x : x + reach, y : y + 1] = 255
    kernel = np.ones((length, 1) if down else (1, length), np.uint8)
    runs = _long_runs(dark, length, down=down)
    assert runs is not None
    assert np.array_equal(runs, cv2.morphologyEx(dark, cv2.MORPH_OPEN, kernel))
    assert _long_runs(np.zeros_like(dark), length, down=down) is None


def test_a_tiny_page_stays() -> None:
    page = np.zeros((20, 30), np.uint8)
    assert without_grids(page) is page
