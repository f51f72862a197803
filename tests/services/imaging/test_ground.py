"""The ground of a photo: paper up to its frame, slivers of a desk at its sides, or something else."""

import cv2
import numpy as np
import pytest

from services.arrays import RgbImage
from services.imaging.ground import find_ground, sides_reached

SIZE = (400, 300)


def paper(shade: float = 0.0) -> RgbImage:
    """A printed page (H, W, 3) that fills its picture, darker by a share `shade` at its right end."""
    page = np.full((*SIZE, 3), 225.0)
    for y in range(40, 220, 14):
        for x in range(30, 260, 9):
            page[y : y + 7, x : x + 5] = 60
    page *= np.linspace(1, 1 - shade, SIZE[1])[None, :, None]
    return np.asarray(page + np.random.default_rng(1).normal(0, 2, page.shape), np.uint8)


def test_a_page_that_fills_its_picture() -> None:
    found = find_ground(paper())
    assert found is not None
    assert found.box == (0, 0, 299, 399)
    assert found.outline is None


@pytest.mark.parametrize("shade", [0.3, 0.5])
def test_light_that_falls_off_is_no_edge(shade: float) -> None:
    assert find_ground(paper(shade)) is not None


def test_a_picture_on_the_page_is_not_its_end() -> None:
    page = paper()
    page[250:350, 60:240] = (30, 60, 120)
    found = find_ground(page)
    assert found is not None
    assert found.box == (0, 0, 299, 399)


def test_a_desk_beside_the_page_is_other_ground() -> None:
    page = paper()
    page[:, :60] = (90, 60, 40)
    assert find_ground(page) is None


def test_an_even_sliver_is_cut() -> None:
    page = paper()
    page[:, :6] = (60, 45, 30)
    page[-4:] = (60, 45, 30)
    found = find_ground(page)
    assert found is not None
    left, top, right, bottom = found.box
    assert (abs(left - 6) <= 1, top, right, abs(bottom - 395) <= 1) == (True, 0, 299, True)


@pytest.mark.parametrize("height", [14, 40])
def test_bars_of_a_program_are_part_of_its_picture(height: int) -> None:
    """With a clock on it, however high it is; bare, or with the grain of a desk, it is none."""
    screen = paper()
    screen[:height] = (40, 20, 60)
    screen[height // 2 - 3 : height // 2 + 3, 250:270:3] = 240
    found = find_ground(screen)
    assert found is not None
    assert found.box == (0, 0, 299, 399)
    grain = np.random.default_rng(0).normal(0, 12, (height, 300, 1))
    screen[:height] = np.clip(screen[:height] + grain, 0, 255).astype(np.uint8)
    found = find_ground(screen)
    assert found is None or found.box[1] == pytest.approx(height, abs=1)


def test_a_wedge_is_drawn_white_and_costs_little_paper() -> None:
    page = paper()
    cv2.fillPoly(page, [np.array([[0, 0], [14, 0], [0, 399]], np.int32)], (60, 45, 30))
    found = find_ground(page)
    assert found is not None
    assert found.box[0] <= 5
    outline = found.outline
    assert outline is not None
    desk = np.zeros(SIZE, np.uint8)
    cv2.fillPoly(desk, [np.round(outline).astype(np.int32)], 1)
    kept = desk > 0
    # Of the wedge nearly nothing is left, and beside it nearly nothing is lost.
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    wedge = x < 14 * (1 - y / 399)
    assert (kept & wedge).sum() < 0.15 * wedge.sum()
    assert (~kept & ~wedge).sum() < 0.15 * wedge.sum()
    # No side but the left one is touched.
    assert outline[:, 0].max() == pytest.approx(299)


def test_print_that_touches_the_frame_is_no_sliver() -> None:
    page = paper()
    page[180:184, :40] = 40
    found = find_ground(page)
    assert found is not None
    assert found.outline is None


@pytest.mark.parametrize("size", [(1, 1), (2, 300), (9, 9)])
def test_tiny_pictures(size: tuple[int, int]) -> None:
    find_ground(np.full((*size, 3), 200, np.uint8))


def test_noise_is_no_ground() -> None:
    noise = np.random.default_rng(2).integers(0, 256, (40, 30, 3)).astype(np.uint8)
    assert find_ground(cv2.resize(noise, SIZE[::-1], interpolation=cv2.INTER_CUBIC)) is None


def test_sides_on_which_the_ground_goes_on_to_the_end_of_the_photo() -> None:
    view = paper()
    shown = np.ones(SIZE, bool)
    assert sides_reached(view, shown) == {"top", "right", "bottom", "left"}
    view[:, 270:] = (90, 60, 40)
    assert sides_reached(view, shown) == {"top", "bottom", "left"}
    # Beyond the photo the view is white: that is no ground.
    view[:30], shown[:30] = 255, False
    assert sides_reached(view, shown) == {"top", "bottom", "left"}
    assert sides_reached(view, np.zeros(SIZE, bool)) == frozenset()
