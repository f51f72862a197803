"""Sharpness tells focus, not light, noise or what is printed."""

import cv2
import numpy as np
import pytest

from services.arrays import RgbImage
from services.mosaic.composition.patch_drawing import FloatMap, Rectangle, prepare_patch
from services.mosaic.composition.sharpness import (
    CellGrid,
    PatchMaps,
    choose_cells,
    compare_sharpness,
    measure_patch,
    print_sharpness,
)
from tests.services.mosaic.cuttings import TEXT_HEIGHT_PX, Box, cut, in_color, prose

ALL = Box(0, 0, 1000, 700)
GRID = choose_cells(1000, 700, TEXT_HEIGHT_PX)


def maps(
    page: RgbImage, box: Box = ALL, *, blur_px: float = 0, gain: float = 1, noise: float = 0
) -> PatchMaps:
    placed = cut(page, box, blur_px=blur_px, gain=gain, noise=noise)
    return measure_patch(prepare_patch(placed, 1000, 700), GRID)


def compared(first: PatchMaps, second: PatchMaps) -> FloatMap:
    """Ratio of the sharpness of two photos of all of the page, where something is printed."""
    ink = np.maximum(first.ink, second.ink)
    sharp = [compare_sharpness(one, ink, GRID.text_height) for one in (first, second)]
    printed = sharp[0] > 0.5 * sharp[0].max()
    return np.asarray(sharp[0][printed] / sharp[1][printed], np.float32)


@pytest.fixture(scope="module")
def page() -> RgbImage:
    return in_color(prose().image)


@pytest.fixture(scope="module")
def usual(page: RgbImage) -> PatchMaps:
    return maps(page, blur_px=0.6)


@pytest.mark.parametrize("gain", [0.4, 0.7])
def test_exposure_does_not_count(page: RgbImage, usual: PatchMaps, gain: float) -> None:
    assert np.abs(compared(maps(page, blur_px=0.6, gain=gain), usual) - 1).max() < 0.03


@pytest.mark.parametrize("blur_px", [0.9, 1.5, 3.0])
def test_blur_loses_everywhere(page: RgbImage, usual: PatchMaps, blur_px: float) -> None:
    ratio = compared(maps(page, blur_px=blur_px), usual)
    assert ratio.max() < 0.92
    assert ratio.min() > 0.1


def test_motion_in_one_direction_loses_to_a_little_blur(page: RgbImage) -> None:
    """Though its gradients across the motion are as strong as ever."""
    for kernel in (np.full((1, 9), 1 / 9), np.full((9, 1), 1 / 9)):
        moved = np.asarray(cv2.filter2D(page, -1, kernel), np.uint8)
        assert np.median(compared(maps(moved, blur_px=0.6), maps(page, blur_px=1.0))) < 0.9


def test_noise_is_no_sharpness(page: RgbImage, usual: PatchMaps) -> None:
    dark_and_noisy = maps(page, blur_px=1.0, gain=0.5, noise=5.0)
    assert compared(dark_and_noisy, usual).max() < 1.0
    # It is what it would be without.
    assert np.abs(np.median(compared(dark_and_noisy, maps(page, blur_px=1.0))) - 1) < 0.08


def test_ink_is_what_is_printed(page: RgbImage, usual: PatchMaps) -> None:
    for line in prose().lines:
        for word in line:
            x0, y0, x1, y1 = (round(v / GRID.side) for v in word.box)
            assert usual.ink[y0 : y1 + 1, x0 : x1 + 1].any(), word
    margin = usual.ink[:, : 40 // GRID.side]
    assert not margin.any()
    blank = maps(np.full_like(page, 200), noise=4.0)
    assert (blank.ink > 0).mean() < 1e-3
    assert print_sharpness(blank) < 0.1 * print_sharpness(usual)


def test_what_is_covered_is_exact(page: RgbImage) -> None:
    part = maps(page, Box(201, 101, 599, 401))
    assert part.box == GRID.cells(Rectangle(201, 101, 398, 300))
    whole = part.covered == 255
    columns = np.nonzero(whole)[1]
    left = (columns.min() + part.box.left) * GRID.side
    right = (columns.max() + part.box.left + 1) * GRID.side
    assert 203 <= left <= 203 + GRID.side
    assert 597 - GRID.side <= right <= 597
    assert not whole[0].any()
    assert not whole[:, -1].any()
    assert part.inset[whole].min() >= 0.9
    assert (part.inset[~whole] == 0).all()


@pytest.mark.parametrize(
    ("width", "height", "text"), [(2500, 3500, 28.0), (30000, 20000, 28.0), (600, 800, 5.0)]
)
def test_maps_are_bounded(width: int, height: int, text: float) -> None:
    grid = choose_cells(width, height, text)
    assert grid.rows * grid.columns < 3.05e6
    assert grid.text_height == pytest.approx(max(text / grid.side, 1.0))
    if (width, height) == (2500, 3500):
        assert 7 <= grid.text_height <= 11


def test_cells_and_pixels() -> None:
    grid = CellGrid(101, 50, 4, 7.0)
    assert (grid.columns, grid.rows) == (26, 13)
    assert grid.cells(Rectangle(5, 8, 10, 4)) == Rectangle(1, 2, 3, 1)
    assert grid.pixels(Rectangle(1, 2, 3, 1)) == Rectangle(4, 8, 12, 4)
    assert grid.cells(Rectangle(5, 8, 0, 0)).width == 0
