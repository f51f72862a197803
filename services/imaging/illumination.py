"""Uneven illumination: its estimation, and its removal for analysis."""

import ctypes
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage
from services.imaging.channels import luminance
from services.imaging.reduction import GROUND_PX
from services.kernels.library import Placing, find_kernels, image_of, is_packed

PRINT_SHARE = 1 / 45
"""Of the long side of a page: wider than the widest stroke (6 mm on A4), and than a line of print."""
_BAND_PIXELS = 1 << 20
"""Full-resolution passes process row bands of about this many pixels, to limit memory."""


MEDIAN_FRACTION = 1 / 16
"""Of the image's long side: a median window that is wider than the residue of a word, narrower than a shadow."""
MEDIAN_TEXT_HEIGHTS = 5.0
"""Median window if the text height is given."""
LARGEST_GAIN = 6.0
"""Largest gain relative to the brightest background. It limits the noise of a dark desk or a picture, while a cast
shadow (about a third of the light) is removed completely."""


def estimate_background(gray: GrayImage, text_height_px: float | None = None) -> GrayImage:
    """Brightness of the bare page at every pixel of `gray`.

    A closing with a window wider than strokes removes print, without the bias of a dilation on a slope. A large median
    filter removes the rest, and keeps the edge of a cast shadow in place. Both run on a reduced copy.

    Parameters
    ----------
    gray : (H, W) uint8
    text_height_px : height of the text (x-height plus ascender) in pixels of `gray`, if known.

    Returns
    -------
    (H, W) uint8, at least 1, at least 1/`LARGEST_GAIN` of its brightest part.
    """
    height, width = gray.shape
    return enlarged(small_background(gray, text_height_px), height, width)


def flatten_illumination(image: NDArray[np.uint8], text_height_px: float | None = None) -> NDArray[np.uint8]:
    """`image`, (H, W) or (H, W, 3) RGB uint8, divided by its background: bare paper becomes 255.

    All channels of a colour image get the gain of the luminance, which keeps hues. For analysis and OCR; for display
    use `normalize_illumination`. Returns a new array of the same shape.
    """
    if image.ndim == 2:
        return divide_by_light(image, small_background(image, text_height_px))
    gray = luminance(image)
    background = estimate_background(gray, text_height_px)
    flat = np.empty_like(image)
    for rows in pixel_bands(*gray.shape):
        cv2.divide(image[rows], cv2.merge([background[rows]] * 3), dst=flat[rows], scale=255.0)
    return flat


def reduced_light(gray: GrayImage) -> GrayImage:
    """Brightness of the bare page as in `estimate_background`, on the reduced copy that it is measured on."""
    return small_background(gray, None)


def divide_by_light(gray: GrayImage, light: GrayImage) -> GrayImage:
    """`gray` (H, W) divided by its light on a reduced copy: bare paper becomes 255."""
    return np.asarray(cv2.divide(gray, enlarged(light, *gray.shape), scale=255.0), dtype=np.uint8)


def flatten_part(part: GrayImage, light: GrayImage, light_from_part: NDArray[np.float64]) -> GrayImage:
    """`part` (H, W) of an image divided by the image's `reduced_light`.

    `light_from_part` (2, 3) maps pixels of the part to pixels of the light; axes stay as they are.
    """
    kernels = find_kernels()
    if light_from_part[0, 1] != 0 or light_from_part[1, 0] != 0:
        raise ValueError("a part lies along its image's axes")
    if kernels is None or not (is_packed(part) and is_packed(light) and part.size and light.size):
        return flatten_part_plain(part, light, light_from_part)
    flat = np.empty(part.shape, np.uint8)
    placing = Placing(*light_from_part[0, [0, 2]], *light_from_part[1, [1, 2]])
    images = [ctypes.byref(image_of(image)) for image in (part, light, flat)]
    if not kernels.flatten_part(*images[:2], ctypes.byref(placing), images[2]):
        raise MemoryError
    return flat


def flatten_part_plain(part: GrayImage, light: GrayImage, light_from_part: NDArray[np.float64]) -> GrayImage:
    """`flatten_part` without a kernel."""
    background = cv2.warpAffine(
        light,
        light_from_part,
        (part.shape[1], part.shape[0]),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(cv2.divide(part, background, scale=255.0), dtype=np.uint8)


def pixel_bands(height: int, width: int) -> list[slice]:
    """Bands of rows of an image, in order, each of about `_BAND_PIXELS`."""
    rows = max(1, _BAND_PIXELS // max(1, width))
    return [slice(top, min(height, top + rows)) for top in range(0, height, rows)]


def reduced_copy(image: NDArray[np.uint8], long_side_px: int) -> tuple[NDArray[np.uint8], float]:
    """Copy of `image` with at most the given long side, by area averages, and the scale factor."""
    height, width = image.shape[:2]
    factor = min(1.0, long_side_px / max(height, width))
    if factor == 1.0:
        return image, factor
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8), factor


def enlarged(small: GrayImage, height: int, width: int) -> GrayImage:
    """`small` (h, w) interpolated to (height, width)."""
    if small.shape == (height, width):
        return small
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def small_background(gray: GrayImage, text_height_px: float | None) -> GrayImage:
    """Background on a copy of at most `GROUND_PX`."""
    return small_backgrounds(gray, text_height_px, (MEDIAN_FRACTION,))[0]


def small_backgrounds(
    gray: GrayImage, text_height_px: float | None, fractions: Sequence[float]
) -> list[GrayImage]:
    """Backgrounds as of `small_background`, one for each median window in `fractions`, that share the closing."""
    small, factor = reduced_copy(gray, GROUND_PX)
    long_side = max(small.shape)
    largest = min(255, 2 * long_side - 1)
    # Strokes are at most about half as wide as the text is high.
    closing_px = PRINT_SHARE * long_side if text_height_px is None else text_height_px * factor
    kernel = cv2.getStructuringElement(cv2.MORPH_RECT, (odd_size(closing_px, 3, largest),) * 2)
    closed = cv2.morphologyEx(small, cv2.MORPH_CLOSE, kernel)
    found = []
    for fraction in fractions:
        median_px = fraction * long_side
        if text_height_px is not None:
            median_px = MEDIAN_TEXT_HEIGHTS * text_height_px * factor
        background = cv2.medianBlur(closed, odd_size(median_px, 3, largest))
        floor = max(1, int(np.ceil(background.max() / LARGEST_GAIN)))
        found.append(np.asarray(np.maximum(background, np.uint8(floor)), dtype=np.uint8))
    return found


def odd_size(size_px: float, least: int, most: int) -> int:
    """Nearest odd integer to `size_px` within [least, most]."""
    return int(2 * np.floor(min(max(size_px, least), max(most, least)) / 2) + 1)
