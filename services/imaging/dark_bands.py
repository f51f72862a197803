"""Bands of light print on dark ground, turned into dark print on light: engines lose letters of the first kind.

Heads of tables, boxes of totals and footers are such bands.
"""

import cv2
import numpy as np

from services.arrays import GrayImage

_LEAST_WIDTH, _LEAST_HEIGHT = 1 / 24, 1 / 90
"""Of the page's width: a word in a band is as long, and a rule is not as high."""
_FILLED = 0.8
"""Of its bounding box at least: bands are rectangles, perhaps with round corners; bold letters that touch are not."""
_DARKER = 80
"""Gray levels between the paper and the ground of a band, and between that and its print."""
_EVEN = 12
"""Gray levels by which pixels of such a ground lie from its usual one."""
_GROUND_SHARE = 0.55
"""Of a band at least: print covers up to a third, and pictures are not even."""
_PRINT_SHARE = 0.01
"""Of a band at least is print; a bar without print need not be turned."""


def with_bands_turned(page: GrayImage) -> GrayImage:
    """The page (H, W), dark print on light paper, in which dark bands with light print are their negatives.

    Their ground has the level of the paper then. It is `page` itself where there are none.
    """
    width = page.shape[1]
    least = max(round(width * _LEAST_WIDTH), 4), max(round(width * _LEAST_HEIGHT), 3)
    paper = float(np.median(page[::8, ::8]))
    dark = np.asarray(cv2.inRange(page, -1.0, paper - _DARKER), np.uint8)
    # What is neither as high nor as wide is print or a rule; most pages have nothing else.
    if not cv2.countNonZero(cv2.erode(dark, np.ones((max(least[1] // 3, 2), least[0] // 4), np.uint8))):
        return page
    turned = page
    for contour in cv2.findContours(dark, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)[0]:
        x, y, wide, high = cv2.boundingRect(contour)
        if wide < least[0] or high < least[1] or cv2.contourArea(contour) < _FILLED * wide * high:
            continue
        part = page[y : y + high, x : x + wide]
        inside = np.zeros(part.shape, np.uint8)
        cv2.drawContours(inside, [contour], -1, 255, cv2.FILLED, offset=(-x, -y))
        levels = _levels_of_band(part[inside > 0])
        if levels is None:
            continue
        ground, print_ = levels
        negative = np.clip((print_ - part.astype(np.float32)) * (paper / (print_ - ground)), 0, paper)
        if turned is page:
            turned = page.copy()
        np.copyto(turned[y : y + high, x : x + wide], negative.astype(np.uint8), where=inside > 0)
    return turned


def _levels_of_band(values: GrayImage) -> tuple[float, float] | None:
    """Gray levels of the ground and of the print of a band with these pixels (N,); None where it is no band."""
    ground = float(np.median(values))
    even = np.abs(values.astype(np.float32) - ground) <= _EVEN
    light = values > ground + _DARKER
    if even.mean() < _GROUND_SHARE or light.mean() < _PRINT_SHARE:
        return None
    return ground, float(np.median(values[light]))
