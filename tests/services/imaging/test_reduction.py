"""A halved image keeps places, levels and colours."""

import numpy as np
import pytest

from services.imaging.reduction import halve


@pytest.mark.parametrize("size", [(400, 300), (401, 303)])
def test_places_stay_where_the_conventions_put_them(size: tuple[int, int]) -> None:
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    image = np.round(20 + 0.25 * x + 0.3 * y).astype(np.uint8)
    small = halve(image).astype(float)
    columns, rows = np.meshgrid(*(2 * np.arange(side // 2) + 0.5 for side in size))
    assert small.shape == columns.shape
    assert np.abs(small - (20 + 0.25 * columns + 0.3 * rows)).max() <= 1.0


def test_fine_stripes_become_gray_and_colours_are_kept() -> None:
    assert np.ptp(halve(np.tile(np.array([0, 255], np.uint8), (64, 32)))) == 0
    image = np.random.default_rng(1).integers(0, 255, (40, 61, 3), dtype=np.uint8)
    assert halve(image).shape == (20, 30, 3)
    assert np.allclose(halve(image).mean(axis=(0, 1)), image[:, :60].mean(axis=(0, 1)), atol=1)
