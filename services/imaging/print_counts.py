"""Ink and paper by their shares of the paper's level, and how often shares of ink occur."""

import ctypes

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, RgbImage
from services.kernels.library import PrintShares, TileCounts, address, find_kernels, image_of, is_packed

PAPER = 200.0
"""Share of 255 that stands for the paper's own level: lighter places have shares too."""


def mark_print(
    gray: GrayImage, ground: GrayImage, ink_below: float, paper_spread: float
) -> tuple[GrayImage, GrayImage]:
    """Which pixels of `gray` (h, w) are ink and which are paper, 0/1, by the level `ground` (h, w) of the paper.

    Ink has less than the share `ink_below` of that level, paper differs from it by `paper_spread` of it at most.
    """
    kernels = find_kernels()
    if kernels is None or gray.shape != ground.shape or not ground.all():
        return mark_print_plain(gray, ground, ink_below, paper_spread)
    levels, light = np.ascontiguousarray(gray), np.ascontiguousarray(ground)
    is_ink, is_paper = np.empty(gray.shape, np.uint8), np.empty(gray.shape, np.uint8)
    shares = _shares(ink_below, paper_spread)
    kernels.mark_print(
        address(levels), address(light), gray.size, ctypes.byref(shares), address(is_ink), address(is_paper)
    )
    return is_ink, is_paper


def mark_print_plain(
    gray: GrayImage, ground: GrayImage, ink_below: float, paper_spread: float
) -> tuple[GrayImage, GrayImage]:
    """`mark_print` by OpenCV: the same."""
    share = cv2.divide(gray, ground, scale=PAPER)
    is_ink, is_paper = (cv2.LUT(share, each.view(np.uint8)) for each in _kinds(ink_below, paper_spread))
    return np.asarray(is_ink, np.uint8), np.asarray(is_paper, np.uint8)


def count_ink(
    image: RgbImage,
    ground: GrayImage,
    is_ink: GrayImage,
    chroma: float,
    grid: tuple[int, int],
    bins: int,
) -> NDArray[np.int64]:
    """How often the strongest channel of neutral ink has each share of the paper's level.

    Parameters
    ----------
    image, ground, is_ink
        (h, w, 3), the level of its paper (h, w), and where there is ink (h, w) 0/1.
    chroma
        Channels of neutral ink differ by less than this share of the paper's level.
    grid, bins
        Rows and columns of equal tiles, and the number of equal ranges of shares.

    Returns
    -------
    (rows, columns, bins)
    """
    kernels = find_kernels()
    if (
        image.shape != (*ground.shape, 3)
        or is_ink.shape != ground.shape
        or min(*grid, bins) < 1
        or bins > 256
    ):
        raise ValueError("ink is counted in tiles of an image whose paper is known")
    if kernels is None or not is_packed(image) or not ground.all():
        return count_ink_plain(image, ground, is_ink, chroma, grid, bins)
    light, ink = np.ascontiguousarray(ground, np.uint8), np.ascontiguousarray(is_ink, np.uint8)
    counts = np.zeros((*grid, bins), np.int64)
    shares = _shares(0.0, 0.0, chroma)
    tiles = TileCounts(address(counts), *grid, bins)
    kernels.count_ink(
        ctypes.byref(image_of(image)), address(light), address(ink), ctypes.byref(shares), ctypes.byref(tiles)
    )
    return counts


def count_ink_plain(
    image: RgbImage,
    ground: GrayImage,
    is_ink: GrayImage,
    chroma: float,
    grid: tuple[int, int],
    bins: int,
) -> NDArray[np.int64]:
    """`count_ink` by OpenCV and NumPy: the same."""
    height, width = ground.shape
    red, green, blue = cv2.split(image)
    strongest, weakest = cv2.max(cv2.max(red, green), blue), cv2.min(cv2.min(red, green), blue)
    is_neutral = (
        np.asarray(cv2.divide(cv2.subtract(strongest, weakest), ground, scale=PAPER)) < PAPER * chroma
    )
    shares = np.asarray(cv2.divide(strongest, ground, scale=PAPER), np.uint8)
    at = np.flatnonzero(is_ink * is_neutral)
    y, x = np.divmod(at, width)
    tile = y * grid[0] // height * grid[1] + x * grid[1] // width
    value = shares.ravel()[at].astype(np.int64) * bins // 256
    return np.bincount(tile * bins + value, minlength=grid[0] * grid[1] * bins).reshape(*grid, bins)


def _kinds(ink_below: float, paper_spread: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which shares (256,) are ink, and which are paper."""
    shares = np.arange(256)
    return shares < PAPER * ink_below, np.abs(shares - PAPER) <= PAPER * paper_spread


def _shares(ink_below: float, paper_spread: float, chroma: float = 0.0) -> PrintShares:
    is_ink, is_paper = _kinds(ink_below, paper_spread)
    paper = np.flatnonzero(is_paper)
    chroma_end = np.count_nonzero(np.arange(256) < PAPER * chroma)
    return PrintShares(PAPER, np.count_nonzero(is_ink), int(paper[0]), int(paper[-1]), chroma_end)
