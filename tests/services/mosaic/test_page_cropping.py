"""The sheet on the whole mosaic."""

import cv2
import numpy as np

from services.mosaic.page_cropping import crop_page, find_page_crop
from tests.services.mosaic.views import page_image

ALL = np.ones((50, 40), bool)


def on_desk(border: int = 60) -> np.ndarray:
    return cv2.copyMakeBorder(page_image(), *(border,) * 4, cv2.BORDER_CONSTANT, value=(90, 70, 50))


def test_a_sheet_on_a_desk_is_cut_out() -> None:
    crop = find_page_crop(on_desk(), ALL)
    assert crop.sheet is not None
    page = crop_page(on_desk(), crop)
    assert abs(page.shape[1] - 1000) < 45
    assert abs(page.shape[0] - 1560) < 45
    # The rim round the sheet comes out white, like paper.
    assert page[:, :3].min() > 250
    assert page[-3:].min() > 250


def test_a_page_that_fills_the_mosaic_is_left_alone() -> None:
    crop = find_page_crop(page_image(), ALL)
    assert (crop.left, crop.top, crop.right, crop.bottom) == (0, 0, 1000, 1560)
    before = page_image()
    assert np.array_equal(crop_page(before.copy(), crop), before)


def test_white_that_no_photo_shows_is_no_paper() -> None:
    # The sheet's lower right quarter was not photographed; beside the sheet lies the desk.
    mosaic = on_desk()
    covered = np.ones(mosaic.shape[:2], bool)
    covered[900:, 600:] = False
    mosaic[~covered] = 255
    crop = find_page_crop(mosaic, covered)
    page = crop_page(mosaic.copy(), crop)
    kept = page_image()[:800, :500]
    left, top = 60 - crop.left, 60 - crop.top
    assert np.array_equal(page[top + 20 : top + 800, left + 20 : left + 500], kept[20:, 20:])


def test_without_text_nothing_is_cropped() -> None:
    crop = find_page_crop(np.full((300, 200, 3), 255, np.uint8), ALL)
    assert (crop.left, crop.top, crop.right, crop.bottom, crop.sheet) == (0, 0, 200, 300, None)
