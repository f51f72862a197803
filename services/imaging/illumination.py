"""Uneven light: its estimate, its removal for analysis, and its evening-out for the eye."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage

_BAND_PIXELS = 1 << 20
"""Full-resolution passes work on row bands of about this many pixels, so that memory stays bounded."""


@dataclass(frozen=True, slots=True)
class BackgroundParameters:
    """How the background of a page is told from what is printed on it.

    Windows are fractions of the image's long side, or multiples of the text height where that is known.
    """

    working_long_side_px: int = 400
    """Size of the copy on which windows are run; light varies slowly, so more only costs time."""
    closing_fraction: float = 1 / 45
    """Closing window, which must be wider than the widest stroke (6 mm on an A4 page)."""
    median_fraction: float = 1 / 16
    """Median window, which must be wider than a word's leftovers and narrower than a shadow."""
    closing_text_heights: float = 1.0
    """Closing window where the text height is given; strokes are at most about half of it."""
    median_text_heights: float = 5.0
    """Median window where the text height is given."""
    largest_gain: float = 6.0
    """No place is brightened by more than this against the brightest background: a dark desk or a
    picture keeps its noise low, while a cast shadow (about a third of the light) is removed whole."""


def estimate_background(
    gray: GrayImage,
    text_height_px: float | None = None,
    parameters: BackgroundParameters = BackgroundParameters(),
) -> GrayImage:
    """Brightness that the bare page would have at every pixel of `gray` (H, W) uint8.

    A closing by a window wider than the strokes removes print, without the bias that a dilation has on a
    slope; a large median removes what is left, and keeps the edge of a cast shadow where it is. Both run
    on a reduced copy.

    Parameters
    ----------
    gray : (H, W) uint8
    text_height_px : height of the text (x-height plus ascender) in pixels of `gray`, where it is known.

    Returns
    -------
    (H, W) uint8, at least 1, at least 1/largest_gain of its brightest part.
    """
    height, width = gray.shape
    return _enlarge(_small_background(gray, text_height_px, parameters), height, width)


def flatten_illumination(
    image: NDArray[np.uint8],
    text_height_px: float | None = None,
    parameters: BackgroundParameters = BackgroundParameters(),
) -> NDArray[np.uint8]:
    """`image`, (H, W) or (H, W, 3) RGB uint8, divided by its background: bare paper becomes 255.

    All channels of a colour image take the gain of its luminance, so that hues stay. Meant for analysis and
    OCR (`normalize_illumination` is for the eye). Returns a new array of the same shape.
    """
    gray = image if image.ndim == 2 else _luminance(image)
    small = _small_background(gray, text_height_px, parameters)
    flat = np.empty_like(image)
    if image.ndim == 2:
        cv2.divide(image, _enlarge(small, *gray.shape), dst=flat, scale=255.0)
        return flat
    background = _enlarge(small, *gray.shape)
    for rows in _row_bands(*gray.shape):
        cv2.divide(image[rows], cv2.merge([background[rows]] * 3), dst=flat[rows], scale=255.0)
    return flat


def _luminance(image: NDArray[np.uint8]) -> GrayImage:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def _row_bands(height: int, width: int) -> list[slice]:
    rows = max(1, _BAND_PIXELS // max(1, width))
    return [slice(top, min(height, top + rows)) for top in range(0, height, rows)]


def _reduce(image: NDArray[np.uint8], long_side_px: int) -> tuple[NDArray[np.uint8], float]:
    """Copy of `image` with at most the given long side, by area averages, and the factor taken."""
    height, width = image.shape[:2]
    factor = min(1.0, long_side_px / max(height, width))
    if factor == 1.0:
        return image, factor
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8), factor


def _enlarge(small: GrayImage, height: int, width: int) -> GrayImage:
    if small.shape == (height, width):
        return small
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def _small_background(
    gray: GrayImage, text_height_px: float | None, parameters: BackgroundParameters
) -> GrayImage:
    """Background on a copy of at most `working_long_side_px`."""
    small, factor = _reduce(gray, parameters.working_long_side_px)
    long_side = max(small.shape)
    closing_px = parameters.closing_fraction * long_side
    median_px = parameters.median_fraction * long_side
    if text_height_px is not None:
        closing_px = parameters.closing_text_heights * text_height_px * factor
        median_px = parameters.median_text_heights * text_height_px * factor
    largest = min(255, 2 * long_side - 1)
    kernel = cv2.getStructuringElement(cv2.MORPH_RECT, (_odd(closing_px, 3, largest),) * 2)
    background = cv2.medianBlur(cv2.morphologyEx(small, cv2.MORPH_CLOSE, kernel), _odd(median_px, 3, largest))
    floor = max(1, int(np.ceil(background.max() / parameters.largest_gain)))
    return np.asarray(np.maximum(background, np.uint8(floor)), dtype=np.uint8)


def _odd(size_px: float, least: int, most: int) -> int:
    """Nearest odd integer to `size_px` within [least, most]."""
    return int(2 * np.floor(min(max(size_px, least), max(most, least)) / 2) + 1)
