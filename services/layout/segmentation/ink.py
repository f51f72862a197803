"""The ink of a page at a working scale, its connected components, and the page's skew."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage
from services.imaging.components import label_components
from services.imaging.illumination import flatten_illumination
from services.layout.segmentation.line_drawings import LEAST_SIDE_PX, MOST_INK, read_drawing

_WORKING_LONG_SIDE_PX = 1760
"""The reduced copy: A4 at 150 dpi, where ten-point print has 20 px to the em."""
_LARGEST_ENLARGEMENT = 1.6
"""Largest enlargement of coarse pages (100 dpi): at whole pixels, similar sizes have the same height."""
_LEAST_ENLARGEMENT = 1.2
"""A smaller enlargement is left out: its blur makes letters touch."""
_INK_CONTRAST = 0.28
"""Ink is darker than its paper by this share of it; light gray print has about 0.35."""
_MOST_COMPONENTS = 12000
"""Of a page with more (dirt, halftones) the largest count; a full page of small print has about 6000."""
LARGEST_SKEW_DEG = 3.0
"""Range of the search; pages come upright."""


_LEAST_HEIGHT_PX = 4
"""Lower components are specks at any working scale, for the unit's sake."""

_WORD_ASPECT = 1.6
"""Wider components are words whose letters touch, not letters."""
_DENSE = 0.4
"""Rows of a word down to the baseline have this share of the ink of its dense rows, at least."""


@dataclass(frozen=True, slots=True, eq=False)
class Ink:
    """Ink of a page on a copy reduced by `scale` (pixels of the page per pixel of the copy, x and y).

    `mask` (h, w) uint8 0/1.
    """

    mask: NDArray[np.uint8]
    scale: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class InkComponents:
    """N connected components of ink in pixels of the working copy.

    `boxes` (N, 4) x0, y0, x1, y1, ends exclusive; `area` (N,) of ink; `stroke` (N,) mean width of strokes;
    `hang` (N,) how far words whose letters touch hang below their baseline, 0 for all others; `slant` (N,) of
    their ink, how far it leans to the right by height: about 0.2 more in italics. `is_border` (N,) are open borders of
    straight lines, `cells` (N,) counts the cells of grids, 0 for all else.
    """

    boxes: NDArray[np.float64]
    area: NDArray[np.float64]
    stroke: NDArray[np.float64]
    hang: NDArray[np.float64]
    slant: NDArray[np.float64]
    is_border: NDArray[np.bool_]
    cells: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.boxes)

    @property
    def width(self) -> NDArray[np.float64]:
        return np.asarray(self.boxes[:, 2] - self.boxes[:, 0])

    @property
    def height(self) -> NDArray[np.float64]:
        return np.asarray(self.boxes[:, 3] - self.boxes[:, 1])


def find_ink(gray: GrayImage) -> Ink:
    """Ink of a page (H, W) uint8, dark or light on its ground, after uneven light is divided out."""
    height, width = gray.shape
    factor = min(_LARGEST_ENLARGEMENT, _WORKING_LONG_SIDE_PX / max(height, width))
    if 1.0 < factor < _LEAST_ENLARGEMENT:
        factor = 1.0
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    interpolation = cv2.INTER_AREA if factor < 1.0 else cv2.INTER_CUBIC
    small = gray if factor == 1.0 else cv2.resize(gray, size, interpolation=interpolation)
    small = np.asarray(small, dtype=np.uint8)
    if _is_inverted(small):
        small = np.asarray(255 - small, dtype=np.uint8)
    flat = flatten_illumination(small)
    _, mask = cv2.threshold(flat, 255 * (1.0 - _INK_CONTRAST), 1, cv2.THRESH_BINARY_INV)
    return Ink(np.asarray(mask, dtype=np.uint8), (width / size[0], height / size[1]))


def _is_inverted(small: GrayImage) -> bool:
    """Whether most of the page is nearer to its darkest print than to its lightest."""
    step = max(1, max(small.shape) // 400)
    sample = small[::step, ::step]
    dark, middle, light = np.percentile(sample, (2, 50, 98))
    return bool(light - dark > 60 and middle - dark < 0.4 * (light - dark))


def find_components(ink: Ink) -> InkComponents:
    """Components of two pixels and more, at most `most_components`: the largest then."""
    count, labels, stats, _ = label_components(ink.mask)
    area = stats[:, cv2.CC_STAT_AREA]
    kept = np.flatnonzero(area > 2)
    kept = kept[kept > 0]
    if kept.size > _MOST_COMPONENTS:
        kept = np.sort(kept[np.argsort(area[kept])[-_MOST_COMPONENTS:]])
    pixels = _InkPixels.of(ink.mask, labels, count)
    runs = pixels.total(pixels.begins)
    x, y = stats[kept, cv2.CC_STAT_LEFT], stats[kept, cv2.CC_STAT_TOP]
    w, h = stats[kept, cv2.CC_STAT_WIDTH], stats[kept, cv2.CC_STAT_HEIGHT]
    # Strokes of all directions: rows and columns cross a stroke of length l 4 l / pi times in the mean.
    length = np.maximum(np.pi / 4 * runs[kept], 1.0)
    boxes = np.column_stack([x, y, x + w, y + h]).astype(np.float64)
    hang = np.zeros(len(kept))
    for index in np.flatnonzero(
        (w > _WORD_ASPECT * h) & (h >= 2 * _LEAST_HEIGHT_PX) & (h < len(labels) / 25)
    ):
        own = labels[y[index] : y[index] + h[index], x[index] : x[index] + w[index]] == kept[index]
        hang[index] = _hang(np.count_nonzero(own, axis=1))
    slant = _slants(pixels)[kept]
    is_border, cells = np.zeros(len(kept), dtype=bool), np.zeros(len(kept), dtype=np.intp)
    for index in np.flatnonzero((np.minimum(w, h) >= LEAST_SIDE_PX) & (area[kept] < MOST_INK * w * h)):
        own = labels[y[index] : y[index] + h[index], x[index] : x[index] + w[index]] == kept[index]
        drawing = read_drawing(own)
        is_border[index], cells[index] = drawing.is_border, drawing.cells
    return InkComponents(
        boxes, area[kept].astype(np.float64), area[kept] / length, hang, slant, is_border, cells
    )


@dataclass(frozen=True, slots=True, eq=False)
class _InkPixels:
    """Pixels of ink: column `x`, row `y` and component `own` (N,) each, of `count` numbers, and which begin runs."""

    x: NDArray[np.intp]
    y: NDArray[np.intp]
    own: NDArray[np.int32]
    begins: NDArray[np.int8]
    """Runs along rows and along columns that begin at the pixel: 0 to 2."""
    count: int

    @classmethod
    def of(cls, mask: NDArray[np.uint8], labels: NDArray[np.int32], count: int) -> "_InkPixels":
        """Of `mask` (H, W). Little of a page is ink: looking up its pixels alone takes a third of the time."""
        columns = mask.shape[1]
        at = np.flatnonzero(mask.view(np.bool_))
        y = at // columns
        x = at - columns * y
        # Nothing lies before the first row and column.
        padded = np.zeros((mask.shape[0] + 1, columns + 1), np.uint8)
        padded[1:, 1:] = mask
        flat, place = padded.ravel(), at + y + columns + 2
        begins = 2 - flat[place - 1] - flat[place - columns - 1]
        return cls(x, y, labels.ravel()[at], begins.astype(np.int8), count)

    def total(self, weights: NDArray[Any]) -> NDArray[np.float64]:
        """Sums (count,) of the pixels' `weights` (N,)."""
        return np.asarray(np.bincount(self.own, weights, self.count), np.float64)


def _slants(ink: _InkPixels) -> NDArray[np.float64]:
    """Slant of every component (count,) by its second moments: shearing back by it makes x and y uncorrelated."""
    area = np.maximum(np.bincount(ink.own, minlength=ink.count), 1)
    up = (ink.total(ink.y) / area)[ink.own] - ink.y
    return np.asarray(ink.total(up * ink.x) / np.maximum(ink.total(np.square(up)), 1e-9))


def _hang(profile: NDArray[np.intp]) -> float:
    """Rows at the foot of a word's `profile` (h,), ink by rows, that only descenders reach; at most a third."""
    dense = np.flatnonzero(profile > _DENSE * np.sort(profile)[-max(1, len(profile) // 3)])
    hang = len(profile) - 1 - int(dense[-1])
    return float(hang) if hang <= len(profile) / 3 else 0.0


def glyph_height(components: InkComponents, page_px: float) -> float:
    """The page's unit: the most frequent height of glyph-like components, weighted by ink, px; 0 without any."""
    height, width = components.height, components.width
    plausible = (height >= _LEAST_HEIGHT_PX) & (height <= page_px / 25)
    plausible &= (width < 12 * height) & (height < 6 * width)
    if not np.any(plausible):
        return 0.0
    height, weight = height[plausible], np.sqrt(components.area[plausible])
    order = np.argsort(height)
    total = np.cumsum(weight[order])
    return float(height[order][np.searchsorted(total, total[-1] / 2)])


def estimate_skew(boxes: NDArray[np.float64]) -> float:
    """Slope dy/dx of the text lines, from the feet of glyphs with boxes (N, 4); 0 when too few form lines.

    The slope at which the feet's projection onto the vertical is the most concentrated.
    """
    if len(boxes) < 10:
        return 0.0
    x, y = (boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]
    x = x - np.mean(x)
    largest = np.tan(np.radians(LARGEST_SKEW_DEG))
    slope = 0.0
    for reach, steps in ((largest, 61), (largest / 20, 21)):
        slopes = slope + np.linspace(-reach, reach, steps)
        slope = float(slopes[np.argmax([_concentration(y - each * x) for each in slopes])])
    # A few glyphs agree on any slope by chance; a level page must not be turned by them.
    level, found = _concentration(y), _concentration(y - slope * x)
    return slope if found > 1.1 * level else 0.0


def _concentration(y: NDArray[np.float64]) -> float:
    """Sum of squares of the histogram of `y`, in bins of 2 px that overlap by half."""
    counts = np.bincount((y - np.min(y)).astype(np.intp)).astype(np.float64)
    return float(np.sum(np.square(counts[1:] + counts[:-1])))
