"""One channel of the three of an image.

Sums are of whole channels: numpy's reductions along so short an axis take five times as long.
"""

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, GrayImage, Mask, RgbImage

Number = TypeVar("Number", np.uint8, np.float32)

BLACK_LEVELS = 8.0
"""Gray levels added before the logarithm of a brightness, so that noise in the dark is no contrast."""


def luminance(image: RgbImage) -> GrayImage:
    """Luminance (H, W) of `image` (H, W, 3)."""
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)


def strongest_channel(image: NDArray[Number]) -> NDArray[Number]:
    """Largest of the three channels (H, W) of `image` (H, W, 3), in its own precision."""
    red, green, blue = cv2.split(image)
    return np.asarray(cv2.max(cv2.max(red, green), blue), image.dtype)


def in_all_channels(values: NDArray[Number]) -> NDArray[Number]:
    """`values` (H, W) in each of three channels (H, W, 3).

    Products with them take a fifth of the time of numpy's with an axis of one channel.
    """
    return np.asarray(cv2.merge((values, values, values)), values.dtype)


def only_where(mask: Mask | GrayImage, image: NDArray[Number]) -> NDArray[Number]:
    """`image` (H, W) or (H, W, 3) where `mask` (H, W) is not 0, elsewhere 0."""
    return np.asarray(cv2.copyTo(image, mask.view(np.uint8)), image.dtype)


def log_brightness(image: RgbImage) -> NDArray[np.float32]:
    """Logarithm (H, W) of the mean of the channels of `image` (H, W, 3)."""
    return np.asarray(_LOG_OF_SUM[sum_of_channels(image)], np.float32)


def sum_of_channels(image: RgbImage) -> NDArray[np.uint16]:
    """Sum (H, W) of the channels of `image` (H, W, 3), of `SUMS` possible ones."""
    total = np.add(image[..., 0], image[..., 1], dtype=np.uint16)
    return np.asarray(np.add(total, image[..., 2], out=total), np.uint16)


SUMS = 3 * 255 + 1
_LOG_OF_SUM = np.log(np.arange(SUMS, dtype=np.float32) / np.float32(3) + BLACK_LEVELS).astype(np.float32)


def mean_of_channels(image: Floats) -> Floats:
    """Mean (H, W) of the channels of `image` (H, W, K), in its own precision."""
    total = image[..., 0] + image[..., 1]
    for channel in range(2, image.shape[2]):
        total += image[..., channel]
    return np.asarray(total / image.dtype.type(image.shape[2]))


def length_of_channels(image: Floats) -> Floats:
    """Euclidean length (H, W) of the vectors of `image` (H, W, K), in its own precision."""
    squares = image * image
    total = squares[..., 0] + squares[..., 1]
    for channel in range(2, image.shape[2]):
        total += squares[..., channel]
    return np.asarray(np.sqrt(total))
