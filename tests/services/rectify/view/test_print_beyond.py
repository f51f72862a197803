"""Light print on a band of the page that differs from its paper as a desk does."""

import cv2
import numpy as np
import pytest

from services.arrays import RgbImage
from services.contract.rectify import RectifyParameters
from services.rectify.pipeline import rectify

pytestmark = pytest.mark.pipeline

BAND = (1000, 1200)
"""First and last row of the band."""


def _photo(*, with_print: bool) -> RgbImage:
    """The lower part of a page that fills the photo's width, seen from below; a blue band is its foot."""
    page = np.full((1200, 1600, 3), 250, np.uint8)
    words = ["Invoice", "number", "seven", "amount", "of", "goods", "and", "services", "in", "total", "paid"]
    for row in range(12):
        line = " ".join(words[(3 * row + k) % len(words)] for k in range(9))
        cv2.putText(
            page, line, (120, 100 + 65 * row), cv2.FONT_HERSHEY_SIMPLEX, 1.1, (30, 30, 30), 3, cv2.LINE_AA
        )
    page[BAND[0] : BAND[1]] = (20, 130, 230)
    if with_print:
        text = "Everything for a smile, every single day"
        cv2.putText(page, text, (120, 1110), cv2.FONT_HERSHEY_SIMPLEX, 1.3, (250, 250, 250), 3, cv2.LINE_AA)
    corners = np.array([[0, 0], [1599, 0], [1599, 1199], [0, 1199]], np.float32)
    seen = np.array([[-60, -20], [1660, -40], [1790, 1230], [-170, 1210]], np.float32)
    photo = cv2.warpPerspective(page, cv2.getPerspectiveTransform(corners, seen), (1600, 1200))
    noise = np.random.default_rng(1).normal(0, 2, photo.shape)
    return np.asarray(np.clip(photo + noise, 0, 255), np.uint8)


def test_a_band_of_the_page_with_light_print_is_shown() -> None:
    photo = _photo(with_print=True)
    answer = rectify(photo, RectifyParameters(upright=False))
    # The band ends with the photo; its print stands in its middle.
    assert np.nanmax(answer.mesh[..., 1]) > 1150
    assert answer.image[-40:, 400:800].mean(axis=(0, 1))[2] > 200


def test_a_band_without_print_may_be_a_desk() -> None:
    photo = _photo(with_print=False)
    answer = rectify(photo, RectifyParameters(upright=False))
    assert np.nanmax(answer.mesh[..., 1]) < 1090
