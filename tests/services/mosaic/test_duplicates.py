"""Copies of a photo are found, photos of the same place are not."""

import cv2
import numpy as np
import pytest

from services.arrays import RgbImage
from services.mosaic.duplicates import find_duplicates
from tests.services.mosaic.views import look_at, page_image, photograph

SIZE = (820, 900)


def photo(x: float = 400.0, kind: int = 0) -> RgbImage:
    return photograph(page_image(kind), look_at((x, 430.0), 15.0, 30.0, 0.95, *SIZE), *SIZE)


def encoded(image: RgbImage, extension: str, quality: int) -> RgbImage:
    flag = cv2.IMWRITE_JPEG_QUALITY if extension == ".jpg" else cv2.IMWRITE_WEBP_QUALITY
    packed = cv2.imencode(extension, image, [flag, quality])[1]
    return np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR), np.uint8)


@pytest.mark.parametrize(("extension", "quality"), [(".jpg", 90), (".jpg", 30), (".webp", 50)])
def test_a_photo_encoded_again_is_a_copy(extension: str, quality: int) -> None:
    assert find_duplicates([photo(), encoded(photo(), extension, quality)]) == {1: 0}


def test_photos_of_places_side_by_side_are_not() -> None:
    assert find_duplicates([photo(), photo(404.0), photo(440.0), photo(kind=1)]) == {}


def test_every_copy_names_the_photo_that_stays() -> None:
    one, other = photo(), photo(kind=1)
    assert find_duplicates([one, other, one, other, one]) == {2: 0, 3: 1, 4: 0}
    assert find_duplicates([one, other, one, other, one], preferred=4) == {0: 4, 2: 4, 3: 1}


def test_photos_without_print_are_no_copies() -> None:
    blank = np.full((90, 80, 3), 200, np.uint8)
    assert find_duplicates([blank, blank]) == {}
    assert find_duplicates([blank, blank[:50]]) == {}
