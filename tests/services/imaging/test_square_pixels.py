"""Pixels of faxes are made square, and what is found is told in those of the file."""

import numpy as np
import pytest

from services.contract.images import ImageLimits
from services.imaging.page_images import PagePicture
from services.imaging.square_pixels import square_pixels

WIDTH, HEIGHT = 200, 120
RAMP = np.ascontiguousarray(
    np.stack([*np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), np.zeros((HEIGHT, WIDTH))], axis=-1).astype(
        np.uint8
    )
)
"""Its pixels say where they are."""


@pytest.mark.parametrize(
    ("aspect", "size", "stretch"), [(0.5, (200, 240), (1.0, 2.0)), (2.0, (400, 120), (2.0, 1.0))]
)
def test_the_coarser_axis_is_enlarged(
    aspect: float, size: tuple[int, int], stretch: tuple[float, float]
) -> None:
    found = square_pixels(PagePicture(RAMP, None, dpi=200.0, pixel_aspect=aspect))
    assert found.pixels.shape == (size[1], size[0], 3)
    assert (found.dpi, found.pixel_aspect, found.stretch, found.size) == (
        200.0,
        1.0,
        stretch,
        (WIDTH, HEIGHT),
    )
    x, y = (np.array([150, 100]) + 0.5) / stretch - 0.5
    assert found.pixels[100, 150, :2] == pytest.approx((x, y), abs=1)


def test_a_page_that_would_become_too_large_is_reduced_along_the_finer_axis() -> None:
    small = ImageLimits(max_megapixels=WIDTH * HEIGHT / 1e6)
    found = square_pixels(PagePicture(RAMP, None, dpi=200.0, pixel_aspect=0.5), small)
    assert found.pixels.shape == (HEIGHT, WIDTH // 2, 3)
    assert (found.dpi, found.stretch) == (100.0, (0.5, 1.0))


def test_square_pixels_are_left_alone() -> None:
    picture = PagePicture(RAMP, None, dpi=300.0)
    assert square_pixels(picture) is picture
