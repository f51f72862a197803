"""Reduced images."""

import cv2
import numpy as np
from numpy.typing import NDArray


def halve(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Half of `image` (H, W) or (H, W, 3) by area averages, without an odd last row or column."""
    height, width = image.shape[0] // 2, image.shape[1] // 2
    even = image[: 2 * height, : 2 * width]
    return np.asarray(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
