"""Reduced images."""

import cv2
import numpy as np
from numpy.typing import NDArray

_LEFT_AFTER_HALVES = 0.5
"""Largest factor of the last step. Averages of averages blur twice: with a last step of 0.9 the variance is twice that
of one step, and small letters ran together; from 0.5 down it is at most a third more."""


def halve(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Half of `image` (H, W) or (H, W, 3) by area averages, without an odd last row or column."""
    height, width = image.shape[0] // 2, image.shape[1] // 2
    even = image[: 2 * height, : 2 * width]
    return np.asarray(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def reduce_image(image: NDArray[np.uint8], factor: float, least_side_px: int = 1) -> NDArray[np.uint8]:
    """`image` (H, W) or (H, W, 3) at `factor` of its size (not above 1) by area averages.

    It is halved while at least another half remains, and then resized to the rest of `factor`. Averages of 2 x 2 pixels
    are four times as fast as those of other areas. An odd last row or column is left out of a half, and the size is
    rounded, so a place is off by at most half a pixel of the answer at its far ends. No side is below `least_side_px`.
    """
    if factor >= 1.0:
        return image
    while 2 * factor <= _LEFT_AFTER_HALVES and min(image.shape[:2]) >= 2 * least_side_px:
        image, factor = halve(image), 2 * factor
    height, width = (max(round(side * factor), least_side_px) for side in image.shape[:2])
    if (height, width) == image.shape[:2]:
        return image
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
