"""Detection of text lines on a flat page without OCR, to cut crops that an OCR engine can read."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, GrayImage
from services.imaging.components import label_components, runs_along_rows
from services.imaging.illumination import flatten_illumination
from services.imaging.reduction import PRINT_PX, reduce_image

_INK_CONTRAST = 0.11
"""Ink is darker than its surroundings by this share of white; faint gray print has about 0.3."""
_SURROUNDINGS = 1 / 30
"""Window of the local mean, as a share of the long side."""
_HEIGHT_QUANTILES = (0.6, 0.9, 0.25)
"""Print sizes that are searched: the ordinary one, headings, and small print next to large print or pictures."""
_HEIGHT_STEP = 1.8
"""Sizes closer than this factor are one."""
_WORD_GAP = 2.2
"""Gaps up to this are closed: wider than between words, narrower than between columns."""
_LEAST_WIDTH = 3.0
"""A shorter line says too little."""
_HEIGHT_RANGE = (0.8, 5.0)
"""Allowed height of a line."""
_FILL_RANGE = (0.08, 0.75)
"""Share of ink in a line's box; rules and frames lie outside."""
_LARGEST_SLOPE = 0.1
"""The page is flat, or nearly so."""
_CLEAR_MASS = 1.0
"""With so much dark print no light print is searched: lines that the dark gaps between light letters make had
up to 0.35 on 13 negatives of pages, the pages' own lines 1.4 to 8.4 on all but three sparse ones."""


_CROP_MARGIN = 0.2
"""Above and below a line in its crop, in heights of the line: dots and tails that the line's box cuts off."""


@dataclass(frozen=True, slots=True)
class TextLine:
    """One line: its box (x0, y0, x1, y1) in pixels of its page, and its slope dy/dx.

    The box contains the line's ink after rotation of the line to the horizontal about the box's centre.
    """

    box: tuple[float, float, float, float]
    slope: float
    strokes: float
    """Runs of ink along the rows, per pixel of width of the working copy; edges of pictures have few."""

    @property
    def width_px(self) -> float:
        return self.box[2] - self.box[0]

    @property
    def height_px(self) -> float:
        return self.box[3] - self.box[1]


@dataclass(frozen=True, slots=True)
class TextLines:
    """Horizontal lines of a page; `inverted` if print is lighter than its background.

    `mass` is the sum of squared line widths over the squared side of the page, weighted by `strokes`. Long lines
    contribute most; fragments across the reading direction and smears contribute little.
    """

    lines: tuple[TextLine, ...]
    mass: float
    inverted: bool


class PageLines:
    """Lines of a flat page along its rows; those along its columns are sought only when they are asked for."""

    def __init__(self, small: GrayImage, scale: tuple[float, float], *, inverted: bool) -> None:
        """`small` (h, w) has dark print, a negative of an `inverted` page; `scale` (x, y) leads to its pixels."""
        self._components = _measure_components(_detect_ink(small))
        self._heights_px = _text_heights(self._components)
        self._scale, self._inverted = scale, inverted
        self.rows = self._along(self._components.height_px, 0)

    @cached_property
    def columns(self) -> TextLines:
        """Lines along the columns, in the frame of the page turned 90 degrees clockwise, where they are horizontal."""
        return self._along(self._components.width_px, 1)

    @property
    def mass(self) -> float:
        """That of the stronger direction."""
        return max(self.rows.mass, self.columns.mass)

    def _along(self, across_px: NDArray[np.float64], turns: int) -> TextLines:
        """Lines of every size of print after `turns` quarters clockwise; `across_px` (N,) is a component's height."""
        found = TextLines((), 0.0, self._inverted)
        scale = self._scale[::-1] if turns else self._scale
        for height_px in self._heights_px:
            ink = np.rot90(_keep_print(self._components, across_px, height_px), -turns)
            lines = _lines_along_rows(np.ascontiguousarray(ink), height_px, scale, self._inverted)
            found = _unite(found, lines)
        return found


def detect_text_lines(gray: GrayImage) -> PageLines:
    """Lines along the rows and along the columns of a flat page.

    Parameters
    ----------
    gray : (H, W) uint8; print may be darker or lighter than its ground.
    """

    factor = min(1.0, PRINT_PX / max(gray.shape))
    small = reduce_image(gray, factor)
    scale = (gray.shape[1] / small.shape[1], gray.shape[0] / small.shape[0])
    dark = PageLines(small, scale, inverted=False)
    if dark.rows.mass >= _CLEAR_MASS or dark.mass >= _CLEAR_MASS or not _has_light_print(small):
        return dark
    light = PageLines(np.asarray(255 - small, dtype=np.uint8), scale, inverted=True)
    # Between dark letters lie light gaps, which make short lines too.
    return light if light.mass > 2 * dark.mass else dark


def _unite(first: TextLines, second: TextLines) -> TextLines:
    """Lines of both; of two overlapping lines only that of `first`."""
    new = second.lines
    if first.lines and new:
        a, b = np.array([line.box for line in first.lines]), np.array([line.box for line in new])
        centre = (b[:, :2] + b[:, 2:]) / 2
        inside = (a[:, None, :2] <= centre) & (centre <= a[:, None, 2:])
        known = np.any(np.all(inside, axis=2), axis=0)
        new = tuple(line for line, old in zip(new, known, strict=True) if not old)
    return TextLines(first.lines + new, max(first.mass, second.mass), first.inverted)


def _has_light_print(small: GrayImage) -> bool:
    """True where strokes that are lighter than their surroundings are not rare against darker ones."""
    window = _surroundings_window(small)
    mean = cv2.blur(small, (window, window), borderType=cv2.BORDER_REPLICATE)
    threshold = 1.5 * 255 * _INK_CONTRAST
    lighter = np.count_nonzero(cv2.subtract(small, mean) > threshold)
    darker = np.count_nonzero(cv2.subtract(mean, small) > threshold)
    return bool(lighter > 0.5 * darker)


def _surroundings_window(small: GrayImage) -> int:
    return 2 * int(_SURROUNDINGS * max(small.shape) / 2) + 3


def _detect_ink(small: GrayImage) -> NDArray[np.uint8]:
    """(h, w) 0/1: pixels that are darker than their surroundings, against white and against the noise."""
    flat = cv2.GaussianBlur(flatten_illumination(small), (3, 3), 0)
    window = _surroundings_window(small)
    size = (window, window)
    mean = cv2.blur(flat, size, borderType=cv2.BORDER_REPLICATE)
    contrast = cv2.subtract(mean, flat)
    # Within print, ink lies at two standard deviations; noise seldom lies at more than one.
    square = cv2.sqrBoxFilter(flat, cv2.CV_32F, size, borderType=cv2.BORDER_REPLICATE)
    deviation = np.subtract(square, np.square(mean, dtype=np.float32), out=square)
    np.sqrt(np.maximum(deviation, 0.0, out=deviation), out=deviation)
    return np.asarray(contrast > np.maximum(255 * _INK_CONTRAST, deviation)).view(np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class _Components:
    """Connected components of ink: labels (h, w), and per label (N,) its sides and area in pixels."""

    labels: NDArray[np.int32]
    width_px: NDArray[np.float64]
    height_px: NDArray[np.float64]
    area_px: NDArray[np.float64]


def _measure_components(ink: NDArray[np.uint8]) -> _Components:
    _, labels, stats, _ = label_components(ink)
    columns = (cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT, cv2.CC_STAT_AREA)
    return _Components(labels, *(stats[:, c].astype(np.float64) for c in columns))


def _text_heights(components: _Components) -> list[float]:
    """Heights (x-heights) of the kinds of print on the page in pixels: the ordinary one first.

    They are quantiles of the sizes of components, weighted by size, since specks are many.
    """
    # The shorter side serves as the size of letters that touch along a line, whichever way the line runs.
    shorter = np.minimum(components.width_px, components.height_px)
    longer = np.maximum(components.width_px, components.height_px)
    limit = 0.1 * max(components.labels.shape)
    plausible = (shorter >= 2) & (longer >= 4) & (shorter < limit) & (longer < 40 * shorter)
    plausible[0] = False
    if not np.any(plausible):
        return []
    sizes = np.sort(shorter[plausible])
    weights = np.cumsum(sizes)
    heights: list[float] = []
    for share in _HEIGHT_QUANTILES:
        height_px = float(sizes[np.searchsorted(weights, share * weights[-1])])
        if all(max(height_px / other, other / height_px) > _HEIGHT_STEP for other in heights):
            heights.append(height_px)
    return heights


def _keep_print(
    components: _Components,
    across_px: NDArray[np.float64],
    height_px: float,
) -> NDArray[np.uint8]:
    """Ink (h, w) 0/1 of print of one size, without rules, frames, blobs and smaller print.

    `across_px` (N,) is the extent of the components across the lines that are searched.
    """
    shorter = np.minimum(components.width_px, components.height_px)
    longer = np.maximum(components.width_px, components.height_px)
    is_blob = shorter > _HEIGHT_RANGE[1] * height_px
    is_rule = (longer > 8 * height_px) & (components.area_px < 0.4 * height_px * longer)
    keep = ~(is_blob | is_rule) & (across_px >= 0.5 * height_px)
    keep[0] = False
    return np.asarray(keep[components.labels], dtype=np.uint8)


def _lines_along_rows(
    ink: NDArray[np.uint8],
    height_px: float,
    scale: tuple[float, float],
    inverted: bool,
) -> TextLines:
    """Lines of `ink` (h, w) 0/1; boxes are multiplied by `scale` (x, y) to the page's own pixels."""
    gap = max(3, int(_WORD_GAP * height_px) | 1)
    joined = cv2.morphologyEx(ink, cv2.MORPH_CLOSE, np.ones((1, gap), np.uint8))
    count, joined_labels = cv2.connectedComponents(joined, connectivity=4)
    labels = np.asarray(joined_labels, dtype=np.int32)
    # All is measured by runs along rows, a quarter as many as pixels: their sums are known, extremes are at their ends.
    y, first, last = runs_along_rows(ink.view(np.bool_))
    label, length, middle = labels[y, first], last - first + 1, (first + last) / 2

    def summed(values: NDArray[Any]) -> Floats:
        return np.asarray(np.bincount(label, values, count))

    # Level every component: regression of y on x from its moments.
    n = np.maximum(summed(length), 1.0)
    mean_x, mean_y = summed(length * middle) / n, summed(length * y) / n
    dx, dy = middle - mean_x[label], y - mean_y[label]
    variance = dx * dx + (length * length - 1) / 12
    slope = summed(length * dx * dy) / np.maximum(summed(length * variance), 1e-9)
    edges = np.zeros((count, 4))
    for end in (first, last):
        end_dx = end - mean_x[label]
        for column, values in ((0, end_dx), (1, dy - slope[label] * end_dx)):
            np.minimum.at(edges[:, column], label, values)
            np.maximum.at(edges[:, column + 2], label, values)
    width, height = edges[:, 2] - edges[:, 0] + 1, edges[:, 3] - edges[:, 1] + 1
    fill = n / (width * height)
    low, high = (limit * height_px for limit in _HEIGHT_RANGE)
    is_line = (
        (height >= low)
        & (height <= high)
        & (width >= _LEAST_WIDTH * height)
        & (fill >= _FILL_RANGE[0])
        & (fill <= _FILL_RANGE[1])
        & (np.abs(slope) <= _LARGEST_SLOPE)
    )
    is_line[0] = False
    strokes = summed(first > 0) / width
    mass = float(np.sum((width**2 * np.minimum(strokes, 1.0))[is_line])) / max(ink.shape) ** 2
    # Residuals are from the slope through the mean; the box is levelled about its own centre.
    shift_y = mean_y + slope * (edges[:, 0] + edges[:, 2]) / 2
    boxes = edges + np.stack([mean_x, shift_y, mean_x, shift_y], axis=1)
    boxes = (boxes + np.array([0.0, 0.0, 1.0, 1.0])) * np.array([*scale, *scale]) - 0.5
    lines = tuple(
        TextLine((b[0], b[1], b[2], b[3]), s * scale[1] / scale[0], d)
        for b, s, d in zip(
            boxes[is_line].tolist(), slope[is_line].tolist(), strokes[is_line].tolist(), strict=True
        )
    )
    return TextLines(lines, mass, inverted)


def crop_place(line: TextLine, height_px: int) -> tuple[float, float]:
    """Where `cut_line` begins on the page (x of the middle of its first pixel), and crop pixels per page pixel."""
    margin = _CROP_MARGIN * line.height_px
    return line.box[0] - 2 * margin, height_px / (line.height_px + 2 * margin)


def cut_line(
    page: GrayImage,
    line: TextLine,
    inverted: bool,
    height_px: int = 36,
    longest: float = 26.0,
    *,
    stretched: bool = True,
) -> GrayImage:
    """Level crop (height_px, w) of one line, dark on white, from a line of any size on `page` (H, W) uint8.

    Lines longer than `longest` times their height are cut there: their first words are enough. `stretched` evens the
    light and clips the noise, which a flat-fielded page does not need.
    """
    margin = _CROP_MARGIN * line.height_px
    x0, zoom = crop_place(line, height_px)
    length = min(line.box[2] + 2 * margin - x0, longest * line.height_px)
    # The row of the line's middle at column x of the page.
    middle_y = (line.box[1] + line.box[3]) / 2 - line.slope * (line.box[0] + line.box[2]) / 2
    ends_y = (middle_y + line.slope * x0, middle_y + line.slope * (x0 + length))
    reach = line.height_px / 2 + margin + 2
    top, left = max(0, int(min(ends_y) - reach)), max(0, int(x0))
    patch = page[top : int(max(ends_y) + reach) + 1, left : int(x0 + length) + 2]
    # Reduce by areas first; reducing by a factor s maps x to (x + 0.5) s - 0.5.
    reduction = min(1.0, zoom)
    size = (max(1, round(patch.shape[1] * reduction)), max(1, round(patch.shape[0] * reduction)))
    reduced = cv2.resize(patch, size, interpolation=cv2.INTER_AREA)
    ratio_x, ratio_y = size[0] / patch.shape[1], size[1] / patch.shape[0]
    origin_y = middle_y + line.slope * x0 - (height_px - 1) / 2 / zoom
    patch_of_crop = np.array(
        [
            [ratio_x / zoom, 0.0, (x0 - left + 0.5) * ratio_x - 0.5],
            [ratio_y * line.slope / zoom, ratio_y / zoom, (origin_y - top + 0.5) * ratio_y - 0.5],
        ]
    )
    crop = cv2.warpAffine(
        reduced,
        patch_of_crop,
        (max(1, round(length * zoom)), height_px),
        flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    dark = np.asarray(255 - crop if inverted else crop, dtype=np.uint8)
    return _stretch(dark) if stretched else dark


def _stretch(crop: GrayImage) -> GrayImage:
    """Ink to black, ground to white, also where a shadow's edge crosses the line.

    The ground's noise is smoothed and clipped: engines take a line of speckles for a picture.
    """
    flat = flatten_illumination(crop, text_height_px=0.6 * crop.shape[0])
    flat = np.asarray(cv2.GaussianBlur(flat, (0, 0), crop.shape[0] / 36), dtype=np.uint8)
    dark, light = np.percentile(flat, (2, 55))
    gain = 255.0 / max(light - dark, 32.0)
    return np.asarray(np.clip((flat.astype(np.float32) - dark) * gain, 0, 255), dtype=np.uint8)
