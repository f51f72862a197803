"""Parts of a photo, pasted."""

import cv2
import numpy as np
import pytest

from services.arrays import RgbImage
from services.geometry.homographies import translation
from services.mosaic.placing import pasting
from services.mosaic.placing.pasting import paste_photos
from tests.services.mosaic.views import page_image

WHOLE: RgbImage = cv2.GaussianBlur(page_image()[:900, :700], (0, 0), 2.0)


def test_parts_make_the_photo_again() -> None:
    parts = {0: WHOLE[:500], 3: WHOLE[300:]}
    picture, H = paste_photos(parts, {0: np.eye(3), 3: translation(0, 300)})
    assert np.array_equal(H, np.eye(3))
    assert np.array_equal(picture, WHOLE)


def test_a_part_that_was_turned_and_resized_lies_where_it_belongs() -> None:
    M = np.vstack([cv2.getRotationMatrix2D((350.0, 600.0), 5.0, 0.7), [0.0, 0.0, 1.0]])
    other = np.asarray(cv2.warpAffine(WHOLE, M[:2], (700, 900), flags=cv2.INTER_AREA), np.uint8)
    picture, H = paste_photos({0: WHOLE[:500], 1: other}, {0: np.eye(3), 1: np.linalg.inv(M)})
    again = cv2.warpPerspective(picture, np.linalg.inv(H), (700, 900))
    seen, true = (image[550:750, 200:500, 0].astype(np.float64) for image in (again, WHOLE))
    (x, y), _ = cv2.phaseCorrelate(seen, true)
    assert np.hypot(x, y) < 0.05


def test_another_exposure_leaves_no_step() -> None:
    dark = np.asarray(WHOLE[300:] * 0.8, np.uint8)
    picture, _ = paste_photos({0: WHOLE[:500], 1: dark}, {0: np.eye(3), 1: translation(0, 300)})
    assert np.abs(picture.astype(int) - WHOLE).mean() < 1.0


def test_what_no_photo_shows_is_filled_without_edges() -> None:
    paper: RgbImage = np.full((400, 400, 3), 190, np.uint8)
    picture, _ = paste_photos({0: paper, 1: paper}, {0: np.eye(3), 1: translation(300, 300)})
    assert picture.shape == (700, 700, 3)
    assert np.abs(picture.astype(int) - 190).max() <= 1


def test_a_large_photo_is_reduced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pasting, "MOST_PIXELS", 1e5)
    parts = {0: WHOLE[:500], 1: WHOLE[300:]}
    picture, H = paste_photos(parts, {0: np.eye(3), 1: translation(0, 300)})
    assert 0.98e5 < picture.shape[0] * picture.shape[1] < 1.02e5
    true = cv2.warpPerspective(cv2.GaussianBlur(WHOLE, (0, 0), 1.2), H, picture.shape[1::-1])
    assert np.abs(picture.astype(int) - true)[5:-5, 5:-5].mean() < 2.0
    assert H[0, 0] == pytest.approx(picture.shape[1] / WHOLE.shape[1], rel=0.01)


def test_wedges_of_a_turned_part_do_not_move_the_middle() -> None:
    M = np.vstack([cv2.getRotationMatrix2D((350.0, 600.0), 4.0, 1.0), [0.0, 0.0, 1.0]])
    turned = np.asarray(cv2.warpAffine(WHOLE, M[:2], (700, 900)), np.uint8)[300:]
    maps = {0: np.eye(3), 1: np.linalg.inv(translation(0, -300) @ M)}
    picture, H = paste_photos({0: WHOLE[:500], 1: turned}, maps)
    middle = np.linalg.inv(H) @ [(picture.shape[1] - 1) / 2, (picture.shape[0] - 1) / 2, 1.0]
    assert np.hypot(*(middle[:2] - [349.5, 449.5])) < 12.0
    # Photos along a diagonal are no wedges.
    paper = WHOLE[:400, :400]
    picture, _ = paste_photos({0: paper, 1: paper}, {0: np.eye(3), 1: translation(300, 300)})
    assert picture.shape == (700, 700, 3)
