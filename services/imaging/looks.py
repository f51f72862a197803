"""Looks of a scanner: a page under even light in gray, or in black and white."""

import cv2
import numpy as np

from services.arrays import GrayImage, Mask, PageImage, RgbImage
from services.contract.rectify import Illumination
from services.imaging.channels import luminance
from services.imaging.row_bands import row_bands

WINDOW = 1 / 60
"""Side of the neighbourhood that a pixel is compared with, of the page's shorter side: two to four lines of print."""
LEAST_WINDOW_PX = 15
CONTRAST = 0.25
"""Ink is darker than the mean of its neighbourhood by this share of it where nothing but paper is around, ..."""
FULL_DEVIATION = 100.0
"""... and by less where gray levels deviate by more, none from this deviation on: close print, of any strength, is cut
at its neighbourhood's mean (Sauvola and Pietikainen 2000)."""
BLACK = 72
"""Gray level below which a pixel is ink whatever is around it: areas of ink stay filled."""
WHITE = 225
"""Gray level from which on a pixel is paper: noise beside dense print."""


def scanner_look(page: RgbImage, look: Illumination) -> PageImage:
    """The `page` (H, W, 3), whose light is even: as it is, (H, W) gray, or (H, W) bool, True for paper."""
    if look == "gray":
        return luminance(page)
    return black_and_white(luminance(page)) if look == "bw" else page


def black_and_white(gray: GrayImage) -> Mask:
    """Where `gray` (H, W), a page under even light, is paper: True, and False on ink.

    Each pixel is compared with its neighbourhood, so that thin strokes, which blur leaves gray, stay whole, and
    neighbouring ones apart.
    """
    height, width = gray.shape
    side = max(round(WINDOW * min(height, width)), LEAST_WINDOW_PX) | 1
    paper = np.empty((height, width), bool)
    for band, seen, inner in row_bands(height, side // 2):
        part = gray[seen].astype(np.float32)
        mean = cv2.blur(part, (side, side), borderType=cv2.BORDER_REPLICATE)
        square = cv2.sqrBoxFilter(part, cv2.CV_32F, (side, side), borderType=cv2.BORDER_REPLICATE)
        deviation = np.sqrt(np.maximum(square - mean * mean, 0.0))
        limit = mean * (1 - CONTRAST * np.maximum(1 - deviation / FULL_DEVIATION, 0.0))
        paper[band] = (part > np.clip(limit, BLACK, WHITE))[inner]
    return paper
