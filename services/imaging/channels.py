"""Sums over an image's channels: numpy's reductions along so short an axis take five times as long."""

import numpy as np

from services.arrays import Floats


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
