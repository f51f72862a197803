"""A word is lost where a piece of it is gone, not where it is blurred, faint or a little beside its place."""

import cv2
import numpy as np

from benchmarks.mosaic.lost_words import lost_words
from services.arrays import GrayImage
from simulation.flat_page import Points
from tests.services.mosaic.cuttings import prose


def lost(picture: GrayImage, shift: float = 0.0) -> list[bool]:
    page = prose()
    words = [word for line in page.lines for word in line][:40]

    def place(points: Points) -> Points:
        return points + shift

    return lost_words(page, picture, place, words).tolist()


def test_blurred_faint_and_shifted_words_are_there() -> None:
    soft = cv2.GaussianBlur(prose().image, (0, 0), 1.5)
    faint = 200 - (255 - soft.astype(np.float32)) * 0.4
    assert not any(lost(np.asarray(faint, np.uint8), 4.0))


def test_a_word_is_lost_with_one_of_its_pieces() -> None:
    picture = prose().image.copy()
    x0, y0, x1, y1 = (round(side) for side in prose().lines[0][1].box)
    picture[y0 : y1 + 1, (x0 + x1) // 2 : x1 + 1] = 255
    assert [number for number, gone in enumerate(lost(picture)) if gone] == [1]
    assert all(lost(np.full_like(picture, 255)))
