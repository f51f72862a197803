"""What engines are given to read."""

import cv2
import numpy as np

from services.layout.pipeline import readable


def test_light_print_in_dark_bands_becomes_dark_print_also_where_the_band_is_a_footer() -> None:
    page = np.full((1754, 1240), 250, np.uint8)
    for y in range(200, 1500, 60):
        cv2.putText(page, "Copper pipe 15 mm 3.40", (90, y), cv2.FONT_HERSHEY_SIMPLEX, 0.8, 0, 2, cv2.LINE_AA)
    boxes = {"TOTAL 1,357.22": (740, 1600, 1150, 1642), "www.example.org": (0, 1690, 1240, 1754)}
    for text, (left, top, right, bottom) in boxes.items():
        page[top:bottom, left:right] = 50
        cv2.putText(page, text, (left + 20, bottom - 12), cv2.FONT_HERSHEY_SIMPLEX, 0.8, 255, 2, cv2.LINE_AA)
    seen = readable(page)
    for left, top, right, bottom in boxes.values():
        before, after = (image[top:bottom, left:right] for image in (page, seen))
        assert (after[before == 50] > 200).all()
        assert np.median(after[before == 255]) < 60


def test_a_page_with_dark_ground_is_left_as_it_is() -> None:
    page = np.full((400, 300), 30, np.uint8)
    page[100:130, 50:250] = 220
    assert readable(page) is page
