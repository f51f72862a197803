"""A program's picture has edges that are exact to the pixel; a camera's has none."""

import cv2
import numpy as np

from services.arrays import RgbImage
from services.imaging.drawn_edges import drawn_box, is_drawn


def window() -> RgbImage:
    """A window with a bar at its head, a panel at its left and stripes for the rows of a list."""
    picture = np.full((600, 800, 3), 250, np.uint8)
    picture[:60] = (30, 90, 50)
    picture[60:, :180] = 235
    for y in range(140, 560, 60):
        picture[y : y + 30, 220:760] = 215
    cv2.putText(picture, "Documents", (220, 110), cv2.FONT_HERSHEY_SIMPLEX, 1.0, (20, 20, 20), 2, cv2.LINE_AA)
    return picture


def test_a_window_is_drawn() -> None:
    assert is_drawn(window())


def test_a_saved_window_is_drawn() -> None:
    _, packed = cv2.imencode(".jpg", window(), [cv2.IMWRITE_JPEG_QUALITY, 90])
    assert is_drawn(np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR)))


def test_a_photo_of_a_window_is_not() -> None:
    level = cv2.GaussianBlur(window(), (0, 0), 0.8)
    assert not is_drawn(level)
    turned = cv2.getRotationMatrix2D((400, 300), 1.0, 1.0)
    assert not is_drawn(cv2.warpAffine(window(), turned, (800, 600), borderMode=cv2.BORDER_REPLICATE))


def test_a_photo_on_a_ground_of_its_own_is_not() -> None:
    framed = np.zeros((700, 900, 3), np.uint8)
    framed[50:650, 50:850] = cv2.GaussianBlur(window(), (0, 0), 0.8)
    assert not is_drawn(framed)


def test_a_blank_picture_is_not() -> None:
    assert not is_drawn(np.full((64, 64, 3), 255, np.uint8))


def test_a_card_on_a_ground_of_one_color_is_cut_out() -> None:
    picture = np.zeros((400, 500, 3), np.uint8)
    picture[100:300, 80:420] = 240
    corners = np.array([(80.4, 100.3), (419.0, 100.3), (419.0, 298.7), (80.4, 298.7)])
    np.testing.assert_allclose(drawn_box(picture, corners), (78, 98, 421, 301), atol=2)
    picture[20:30, 200:260] = 200
    assert drawn_box(picture, corners) == drawn_box(picture, None) == (0, 0, 499, 399)
