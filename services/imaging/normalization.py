"""Removal of uneven illumination for display: dark ink on white paper (dissertation 4.4)."""

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Points, RgbImage
from services.imaging.channels import luminance, strongest_channel
from services.imaging.illumination import pixel_bands
from services.imaging.levels import (
    PAPER_SPREAD,
    Levels,
    level_coefficients,
    measure_levels,
    neutral_gains,
)
from services.imaging.pictures import levels_beside_pictures, pictures_without_text

LUMINANCE = np.array([0.299, 0.587, 0.114], np.float32)
"""Weights of red, green and blue in the luminance (Rec. 601)."""


def normalize_illumination(image: RgbImage, characters: Points | None = None) -> RgbImage:
    """Dark ink on white paper, light and shadow evened out; a new image (H, W, 3) RGB uint8.

    Localized histogram normalization (dissertation 4.4): the two modes of every neighbourhood's histogram
    are shifted to white and deep dark by an affine map of the luminance, so that the transition between
    them is preserved. Both levels are measured on a reduced copy and interpolated. A place that is not paper
    (a picture, a desk) takes the light of the paper around it, and its dark levels stay unchanged, so that figures
    are neither bleached nor crushed. Colours are kept, but for a tint of the paper that may come from the light
    (`neutral_gains`). An image without print on paper is returned as it is.

    `characters` (N, 2) are the places of all text in pixels of `image`. With them, dark parts without text
    are pictures and those with text are shadows; without them, only a part that touches no paper is a picture.
    """
    levels = measure_levels(image)
    if levels is None:
        return image.copy()
    if characters is not None:
        levels = levels_beside_pictures(image, levels, pictures_without_text(levels, image, characters))
    ink = levels.ink * levels.measured
    colour = _paper_colour(image, levels)
    balance = neutral_gains(colour)
    brighter = np.float32((LUMINANCE @ (balance * colour)) / max(LUMINANCE @ colour, 1.0))
    return _apply_levels(image, level_coefficients(levels.paper * brighter, ink / brighter), balance)


def _paper_colour(image: RgbImage, levels: Levels) -> NDArray[np.float32]:
    """Typical colour (3,) of the paper in `image`, the channels 0-255; gray where none was measured."""
    height, width = levels.paper.shape
    small = np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    near = np.abs(luminance(small) - levels.paper) <= PAPER_SPREAD * levels.paper
    paper = small[near & (levels.measured > 0.5)]
    return np.asarray(np.median(paper, axis=0) if len(paper) else np.full(3, 255.0), np.float32)


def _apply_levels(
    image: RgbImage, coefficients: NDArray[np.float32], balance: NDArray[np.float32]
) -> RgbImage:
    """Channels times the first coefficient, plus the strongest channel times the second, plus the third.

    The channels are multiplied by `balance` (3,) before. `coefficients` (h, w, 3) are interpolated to the image's size,
    band by band.
    """
    height, width = image.shape[:2]
    small = coefficients
    result = np.empty_like(image)
    # Rows of the small arrays; reducing by s maps y to (y + 0.5) s - 0.5.
    place = np.clip((np.arange(height) + 0.5) * small.shape[0] / height - 0.5, 0, small.shape[0] - 1)
    above = np.minimum(place.astype(np.int64), max(0, small.shape[0] - 2))
    part = (place - above).astype(np.float32)[:, None, None]
    for rows in pixel_bands(height, width):
        upper = small[above[rows]]
        lower = small[np.minimum(above[rows] + 1, small.shape[0] - 1)]
        stretched = cv2.resize(upper + (lower - upper) * part[rows], (width, rows.stop - rows.start))
        gain, slope, offset = cv2.split(stretched)
        band = image[rows].astype(np.float32) * balance
        added = cv2.add(cv2.multiply(strongest_channel(band), slope), offset)
        for channel in range(3):
            value = cv2.multiply(band[..., channel], gain)
            result[rows, :, channel] = np.clip(cv2.add(value, added) + 0.5, 0, 255)
    return result
