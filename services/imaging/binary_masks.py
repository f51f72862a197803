"""Masks by the squares round their pixels: spread, closed, and found by a threshold of their own."""

import ctypes

import cv2
import numpy as np

from services.arrays import GrayImage, Mask
from services.imaging.row_bands import row_bands
from services.kernels.library import Threshold, find_kernels, image_of, is_packed

LARGEST_WINDOW_PX = 181
"""Of which a sum of squares of bytes fits into 31 bits."""


def spread_mask(mask: Mask, side: int) -> Mask:
    """Pixels with one of the `mask` (H, W) in the square of the odd `side` round them."""
    return _by_kernel(mask, side, closes=False)


def close_mask(mask: Mask, side: int) -> Mask:
    """`mask` (H, W) and what squares of the odd `side` beside it do not reach: it is spread by them, and taken in."""
    return _by_kernel(mask, side, closes=True)


def _by_kernel(mask: Mask, side: int, *, closes: bool) -> Mask:
    kernels = find_kernels()
    if side % 2 == 0:
        raise ValueError("the square's side is odd")
    if kernels is None or not mask.size:
        return close_mask_plain(mask, side) if closes else spread_mask_plain(mask, side)
    mask, found = np.ascontiguousarray(mask), np.empty(mask.shape, np.uint8)
    image = ctypes.byref(image_of(mask.view(np.uint8)))
    if not kernels.spread_mask(image, ctypes.byref(image_of(found)), side // 2, closes):
        raise MemoryError
    return found.view(np.bool_)


def spread_mask_plain(mask: Mask, side: int) -> Mask:
    """`spread_mask` without a kernel.

    A sum over a square costs the same at any side, a dilation as much as its side is long.
    """
    count = cv2.boxFilter(
        np.ascontiguousarray(mask).view(np.uint8),
        cv2.CV_32F,
        (side, side),
        normalize=False,
        borderType=cv2.BORDER_CONSTANT,
    )
    return np.asarray(count > 0.5)


def close_mask_plain(mask: Mask, side: int) -> Mask:
    """`close_mask` without a kernel."""
    return ~spread_mask_plain(~spread_mask_plain(mask, side), side)


def threshold_by_windows(gray: GrayImage, area: Mask, side: int, k: float, contrast: float) -> Mask:
    """Pixels of `area` (H, W) darker than mean + `k` deviation of the window of the odd `side` round them.

    There the deviation is above `contrast` gray levels. Windows are at most `LARGEST_WINDOW_PX` large.
    """
    kernels = find_kernels()
    side = min(side, LARGEST_WINDOW_PX)
    if side % 2 == 0 or gray.shape != area.shape:
        raise ValueError("windows have a middle, and each pixel is in the area or not")
    if kernels is None or not is_packed(gray) or not gray.size:
        return threshold_by_windows_plain(gray, area, side, k, contrast)
    area, ink = np.ascontiguousarray(area), np.zeros(gray.shape, np.uint8)
    images = (ctypes.byref(image_of(image)) for image in (gray, area.view(np.uint8), ink))
    if not kernels.threshold_windows(*images, ctypes.byref(Threshold(k, contrast, side // 2))):
        raise MemoryError
    return ink.view(np.bool_)


def threshold_by_windows_plain(gray: GrayImage, area: Mask, side: int, k: float, contrast: float) -> Mask:
    """`threshold_by_windows` without a kernel."""
    ink = np.zeros(gray.shape, bool)
    for rows, seen, inner in row_bands(len(gray), side // 2):
        values = gray[seen]
        mean = cv2.boxFilter(values, cv2.CV_32F, (side, side), borderType=cv2.BORDER_REFLECT)[inner]
        square = cv2.sqrBoxFilter(values, cv2.CV_32F, (side, side), borderType=cv2.BORDER_REFLECT)[inner]
        # In place: new arrays of this size cost more than the sums.
        deviation = np.subtract(square, mean * mean, out=square)
        np.sqrt(np.maximum(deviation, 0.0, out=deviation), out=deviation)
        seen_ink = area[rows] & (deviation > contrast)
        threshold = np.add(mean, np.multiply(deviation, k, out=deviation), out=mean)
        ink[rows] = seen_ink & (values[inner] < threshold)
    return ink
