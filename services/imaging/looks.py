"""Looks of a scanner: a page under even light in gray, or in black and white."""

import cv2
import numpy as np

from services.arrays import GrayImage, Mask, PageImage, RgbImage
from services.contract.rectify import Illumination
from services.imaging.channels import luminance
from services.imaging.row_bands import row_bands

WINDOW = 1 / 110
"""Side of the neighbourhood that a pixel is compared with, of the page's shorter side: about the height of small print,
so that it holds a stroke and its paper, and the counters of bold letters count as paper."""
LEAST_WINDOW_PX = 7
LEAST_CONTRAST = 48
"""Gray levels by which ink is darker than the paper around it: print of the other side that shines through is by 25."""
FILLED = 96
"""Gray level below which an area without contrast is ink: the light is even, and paper is white."""


def scanner_look(page: RgbImage, look: Illumination) -> PageImage:
    """The `page` (H, W, 3), whose light is even: as it is, (H, W) gray, or (H, W) bool, True for paper."""
    if look == "gray":
        return luminance(page)
    return black_and_white(luminance(page)) if look == "bw" else page


def black_and_white(gray: GrayImage) -> Mask:
    """Where `gray` (H, W), a page under even light, is paper: True, and False on ink.

    Each pixel is compared with the middle between the lightest and the darkest of its neighbourhood. So a thin stroke
    that blur leaves light gray stays whole, and bold ones do not grow.
    """
    height, width = gray.shape
    side = max(round(WINDOW * min(height, width)), LEAST_WINDOW_PX) | 1
    window = np.ones((side, side), np.uint8)
    paper = np.empty((height, width), bool)
    for band, seen, inner in row_bands(height, 2 * side):
        part = gray[seen]
        calm = cv2.blur(part, (3, 3))  # a single noisy pixel is no ink
        darkest = cv2.blur(cv2.erode(calm, window), (side, side))
        lightest = cv2.blur(cv2.dilate(calm, window), (side, side))
        middle = cv2.addWeighted(darkest, 0.5, lightest, 0.5, 0.0)
        limit = np.minimum(middle, lightest - np.minimum(lightest, LEAST_CONTRAST))
        paper[band] = ((part > limit) & ((part >= FILLED) | (lightest >= FILLED)))[inner]
    return paper
