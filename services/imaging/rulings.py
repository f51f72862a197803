"""Grids of ruled tables: found in a page, and taken out of it before it is read.

An OCR engine takes a grid for a picture, or its strokes for letters. Of made invoices with a grid Tesseract loses whole
rows at 300 dpi (docs/decisions/layout-tables.md).
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage

_LEVEL_SHARE, _UPRIGHT_SHARE = 1 / 12, 1 / 24
"""Shortest level and upright rule, as shares of the page's width: print has no strokes as long."""
_DARK = 40
"""Least difference of a rule from the paper around it, in gray levels; hairlines are grayed when they are scanned."""
_FEWEST_LEVEL, _FEWEST_UPRIGHT = 2, 3
"""Rules that cross each other from which on they are a grid: an underline and a frame are none."""
_PAD_PX = 1
"""What is taken out around a rule: its edge is gray."""


def without_grids(page: GrayImage) -> GrayImage:
    """The page (H, W), dark on light, with the rules of its tables painted as paper; the same object without a grid."""
    height, width = page.shape
    level_px, upright_px = round(width * _LEVEL_SHARE), round(width * _UPRIGHT_SHARE)
    if min(level_px, upright_px) < 8 or height < 2 * upright_px:
        return page
    paper = int(np.median(page[::8, ::8]))
    dark = (page < paper - _DARK).astype(np.uint8)
    level = np.asarray(cv2.morphologyEx(dark, cv2.MORPH_OPEN, np.ones((1, level_px), np.uint8)), np.uint8)
    upright = np.asarray(cv2.morphologyEx(dark, cv2.MORPH_OPEN, np.ones((upright_px, 1), np.uint8)), np.uint8)
    if not level.any() or not upright.any():
        return page
    rules = _grids(level, upright)
    if not rules.any():
        return page
    around = cv2.dilate(rules, np.ones((2 * _PAD_PX + 1, 2 * _PAD_PX + 1), np.uint8))
    cleaned = page.copy()
    cleaned[around > 0] = paper
    return cleaned


def _grids(level: NDArray[np.uint8], upright: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The rules (H, W) that belong to grids: connected ones of which enough are level and enough upright."""
    joined = cv2.dilate(level | upright, np.ones((3, 3), np.uint8))
    count, groups = cv2.connectedComponents(joined, connectivity=8)
    of_pixels = np.asarray(groups, np.int32)
    levels, uprights = _rules_of(level, of_pixels, count), _rules_of(upright, of_pixels, count)
    is_grid = (levels >= _FEWEST_LEVEL) & (uprights >= _FEWEST_UPRIGHT)
    is_grid[0] = False
    return np.asarray((level | upright) * is_grid[of_pixels], np.uint8)


def _rules_of(rules: NDArray[np.uint8], groups: NDArray[np.int32], count: int) -> NDArray[np.intp]:
    """How many rules each of `count` groups has."""
    number, own, stats, _ = cv2.connectedComponentsWithStats(rules, connectivity=8)
    found = np.zeros(count, np.intp)
    for rule in range(1, number):
        x, y, w, h = stats[rule, :4]
        group = groups[y : y + h, x : x + w][own[y : y + h, x : x + w] == rule]
        found[int(group[0])] += 1
    return found
