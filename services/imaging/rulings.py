"""Grids of ruled tables: taken out of a page before it is read, and the cells between their rules.

An OCR engine takes a grid for a picture, or its strokes for letters. Of made invoices with a grid Tesseract loses whole
rows at 300 dpi (docs/decisions/layout-tables.md).
"""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage
from services.contract.boxes import Sides
from services.imaging.illumination import flatten_illumination
from services.imaging.reduction import halve

_LEVEL_SHARE, _UPRIGHT_SHARE = 1 / 12, 1 / 24
"""Shortest level and upright rule, as shares of the page's width: print has no strokes as long."""
_DARK = 40
"""Least difference of a rule from the paper around it, in gray levels; hairlines are grayed when they are scanned."""
_WIDEST_SHARE = 1 / 150
"""Of the page's width (1.4 mm of A4): what is wider is a band with light print, the shade of a row, or a picture."""
_FEWEST_LEVEL, _FEWEST_UPRIGHT = 2, 3
"""Rules that cross each other from which on they are a grid: an underline and a frame are none."""
_CELL_PX = 8
"""Least width and height of a cell: double rules have narrow boxes between them."""
_LARGE_PX = 2400
"""Longest side of a page on which cells are looked for, A4 at 200 dpi: hairlines are to stay dark."""
_PAD_PX = 1
"""What is taken out around a rule: its edge is gray."""


def without_grids(page: GrayImage) -> GrayImage:
    """The page (H, W), dark on light, with the rules of its tables painted as paper; the same object without a grid."""
    rules = _find_grids(page)
    if rules is None:
        return page
    around = cv2.dilate(rules, np.ones((2 * _PAD_PX + 1, 2 * _PAD_PX + 1), np.uint8))
    cleaned = page.copy()
    cleaned[around > 0] = _level_of_paper(page)
    return cleaned


def cells_of_grids(page: GrayImage) -> list[list[Sides]]:
    """The boxes between the rules of each grid on the page (H, W), dark on light, by their tops and left ends.

    Large pages are halved: the sides of a cell lie in the paper around its words. In even light the edge of a shadow is
    no rule.
    """
    small = page
    while max(small.shape) > _LARGE_PX:
        small = halve(small)
    rules = _find_grids(flatten_illumination(small))
    if rules is None:
        return []
    joined = cv2.dilate(rules, np.ones((3, 3), np.uint8))
    count, numbers, boxes, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    groups, scale = np.asarray(numbers, np.int32), page.shape[1] / small.shape[1]
    tables = [_cells_between(groups, number, boxes[number].tolist()) for number in range(1, count)]
    return [[tuple(scale * side for side in cell) for cell in cells] for cells in tables]


def _cells_between(numbers: NDArray[np.int32], number: int, box: Sequence[int]) -> list[Sides]:
    x, y, width, height = box[:4]
    free = (numbers[y : y + height, x : x + width] != number).astype(np.uint8)
    _, _, cells, _ = cv2.connectedComponentsWithStats(free, connectivity=4)
    found = [(x + left, y + top, x + left + w, y + top + h) for left, top, w, h in cells[1:, :4].tolist()]
    return sorted(
        (cell for cell in found if min(cell[2] - cell[0], cell[3] - cell[1]) >= _CELL_PX),
        key=lambda cell: (cell[1], cell[0]),
    )


def _level_of_paper(page: GrayImage) -> int:
    return int(np.median(page[::8, ::8]))


def _find_grids(page: GrayImage) -> NDArray[np.uint8] | None:
    """The rules (H, W) of the page's grids, 0 or 255; None without a grid."""
    height, width = page.shape
    level_px, upright_px = round(width * _LEVEL_SHARE), round(width * _UPRIGHT_SHARE)
    if min(level_px, upright_px) < 8 or height < 2 * upright_px:
        return None
    dark = np.asarray(cv2.inRange(page, -1.0, _level_of_paper(page) - _DARK - 1.0), np.uint8)
    # Most pages have no grid, whatever is wide; only on others is it worth its time to tell what is narrow.
    if _grids_of(dark, level_px, upright_px) is None:
        return None
    around = np.ones((max(round(width * _WIDEST_SHARE), 3),) * 2, np.uint8)
    narrow = cv2.inRange(cv2.morphologyEx(page, cv2.MORPH_BLACKHAT, around), _DARK + 1.0, 256.0)
    return _grids_of(np.asarray(cv2.bitwise_and(dark, narrow), np.uint8), level_px, upright_px)


def _grids_of(dark: NDArray[np.uint8], level_px: int, upright_px: int) -> NDArray[np.uint8] | None:
    level = _long_runs(dark, level_px)
    if level is None:
        return None
    upright = _long_runs(dark, upright_px, down=True)
    if upright is None:
        return None
    rules = _grids(level, upright)
    return rules if rules.any() else None


def _long_runs(dark: NDArray[np.uint8], length: int, *, down: bool = False) -> NDArray[np.uint8] | None:
    """The parts of `dark` (H, W), 0 or 255, that are this long across, or `down`; at its ends half of it is enough.

    None if there are none. Only rows, or columns, are opened in which two quarters of the length are dark in one piece,
    or the last one before the end: few are, and to open a page of 12 megapixels takes 10 to 70 ms.
    """
    quarter = max(length // 4, 1)
    size = (dark.shape[1], dark.shape[0] // quarter) if down else (dark.shape[1] // quarter, dark.shape[0])
    whole = dark[: size[1] * quarter] if down else dark[:, : size[0] * quarter]
    is_dark = cv2.resize(whole, size, interpolation=cv2.INTER_AREA) == 255
    is_dark = is_dark if down else is_dark.T
    lines = np.flatnonzero((is_dark[1:] & is_dark[:-1]).any(axis=0) | is_dark[-1])
    at = np.s_[:, lines] if down else np.s_[lines]
    kernel = np.ones((length, 1) if down else (1, length), np.uint8)
    runs = np.zeros_like(dark)
    if len(lines):
        runs[at] = cv2.morphologyEx(np.ascontiguousarray(dark[at]), cv2.MORPH_OPEN, kernel)
    return runs if cv2.countNonZero(runs) else None


def _grids(level: NDArray[np.uint8], upright: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The rules (H, W) that belong to grids: connected ones of which enough are level and enough upright."""
    found = np.asarray(cv2.bitwise_or(level, upright), np.uint8)
    x, y, width, height = cv2.boundingRect(found)
    part = np.s_[y : y + height, x : x + width]
    joined = cv2.dilate(found[part], np.ones((3, 3), np.uint8))
    count, numbers = cv2.connectedComponents(joined, connectivity=8)
    groups = np.asarray(numbers, np.int32)
    levels, uprights = (_rules_of(rules[part], groups, count) for rules in (level, upright))
    is_grid = (levels >= _FEWEST_LEVEL) & (uprights >= _FEWEST_UPRIGHT)
    if not is_grid.any():
        return np.zeros_like(level)
    rows, columns = _pixels(found[part])
    found[y + rows, x + columns] = is_grid[groups[rows, columns]]
    return found


def _rules_of(rules: NDArray[np.uint8], groups: NDArray[np.int32], count: int) -> NDArray[np.intp]:
    """How many rules each of `count` groups has; all of a rule is in one group."""
    _, own = cv2.connectedComponents(rules, connectivity=8)
    at = _pixels(rules)
    _, first = np.unique(own[at], return_index=True)
    return np.bincount(groups[at][first], minlength=count)


def _pixels(mask: NDArray[np.uint8]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Rows and columns (N,) of the pixels of `mask` that are not 0; OpenCV finds them in an eighth of NumPy's time."""
    found = cv2.findNonZero(np.ascontiguousarray(mask))
    at = np.zeros((0, 2), np.int32) if found is None else np.asarray(found, np.int32).reshape(-1, 2)
    return at[:, 1], at[:, 0]
