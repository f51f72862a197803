"""Reduced images keep places and levels."""

import numpy as np
import pytest

from services.imaging.reduction import halve, reduce_image


@pytest.mark.parametrize("size", [(400, 300), (401, 303), (807, 611), (1603, 1201)])
@pytest.mark.parametrize("wanted", [(100, 75), (199, 150), (150, 113)])
def test_places_stay_where_the_conventions_put_them(size: tuple[int, int], wanted: tuple[int, int]) -> None:
    width, height = size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    image = np.round(20 + 100 * x / width + 100 * y / height).astype(np.uint8)
    small = reduce_image(image, *wanted).astype(float)
    assert small.shape == wanted[::-1]
    columns = (np.arange(wanted[0]) + 0.5) * width / wanted[0] - 0.5
    rows = (np.arange(wanted[1]) + 0.5) * height / wanted[1] - 0.5
    true = 20 + 100 * columns / width + 100 * rows[:, None] / height
    # Rounding of both images, and odd rows and columns that are left out: three pixels of 400, of 200 levels.
    assert np.abs(small - true)[2:-2, 2:-2].max() < 2.6
    assert abs((small - true)[2:-2, 2:-2].mean()) < 0.9


def test_fine_patterns_become_gray_and_not_stripes() -> None:
    stripes = np.tile(np.array([0, 255], np.uint8), (640, 320))
    for wanted in (160, 250, 300):
        assert np.ptp(reduce_image(stripes, wanted, wanted)[4:-4, 4:-4].astype(int)) <= 2


def test_small_images_stay_as_they_are_and_colours_are_kept() -> None:
    image = np.random.default_rng(1).integers(0, 255, (40, 61, 3), dtype=np.uint8)
    assert np.array_equal(reduce_image(image, 80, 90), image)
    assert halve(image).shape == (20, 30, 3)
    assert np.allclose(reduce_image(image, 30, 20).mean(axis=(0, 1)), image.mean(axis=(0, 1)), atol=2)
