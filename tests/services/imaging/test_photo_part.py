"""Parts of photos: what they show, where it is, and in which light."""

import numpy as np
import pytest

from services.imaging.illumination import flatten_illumination, reduced_light
from services.imaging.photo_part import cut_part
from services.imaging.reduction import reduce_image


@pytest.mark.parametrize("factor", [1.0, 0.5])
def test_a_part_is_the_flat_fielded_photo_there(factor: float) -> None:
    y, x = np.mgrid[0:600, 0:800]
    light = 90 + 120 * x / 800 + 30 * y / 600
    print_ = ((x // 6) % 5 == 0) & ((y // 20) % 3 == 0)
    photo = np.where(print_, 0.3 * light, light).astype(np.uint8)
    first, last = np.array([160, 80]), np.array([640, 480])
    part = cut_part(photo, reduced_light(photo), first, last, factor)
    whole = flatten_illumination(reduce_image(photo, factor))
    left, top = (round(v * factor) for v in first)
    seen = whole[top:, left:][: part.image.shape[0], : part.image.shape[1]].astype(int)
    assert np.abs(seen - part.image).mean() < 2
    assert np.median(part.image[part.image > 200]) > 240, "bare paper is white in any light"


def test_pixels_of_a_part_have_their_place_in_the_photo() -> None:
    rng = np.random.default_rng(3)
    photo = rng.integers(180, 220, (400, 500), dtype=np.uint8)
    photo[201:203, 301:303] = 20
    part = cut_part(photo, reduced_light(photo), np.array([101, 51]), np.array([471, 391]), 0.5)
    row, column = np.unravel_index(int(np.argmin(part.image)), part.image.shape)
    assert part.to_photo(np.array([[column, row]], np.float64))[0] == pytest.approx((301.5, 201.5))
