"""The reduced photo in which outlines are searched: without print and without black bands."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, RgbImage
from services.geometry.homographies import from_resized
from services.imaging.channels import length_of_channels, strongest_channel
from services.imaging.reduction import GROUND_PX, Halves
from services.order_statistics import percentile
from services.sheet.outline.colors import Codes, color_codes

# How far the photo is reduced, and what counts as a black band.
MEDIUM_LONG_SIDE_PX = 1600
"""Edges are followed at half of this at least, before they are measured in the photo itself."""
CLOSING = 1 / 60
"""Of the long side: wider than a line of print."""
CONTRAST = (3.0, 8.0)
"""Colour difference (CIE Lab) on which an edge counts half: at least and at most, ..."""
UNREST_FACTOR = 3.0
"""... this many times the variation of the photo, ..."""
UNREST_PERCENTILE = 80.0
"""... which is this percentile of the differences over three pixels: 0.6-1.1 on plain grounds, 2-5 on wood."""
LEAST_SIDE_PX = 64
"""Of a photo in which a sheet is looked for."""
BAND_LEVEL = 10
"""Brightness of padding at most; JPEG leaves some."""
BAND_DIFFERENCE = 2
"""Pixels of the reduced photo by which the bands on both sides differ at most."""
BAND_SHARE = 0.85
"""Share of a band's border at which the photo begins at the same row or column."""


@dataclass(frozen=True, slots=True, eq=False)
class ReducedPhoto:
    """`colors` (h, w, 3) float32: CIE Lab of the photo resized by `factor`, print closed; `codes` (h, w): their bins.

    `contrast` is the colour difference on which an edge counts half: it is above the variation of the photo.
    `window` (x0, y0, x1, y1), inclusive pixels, is the part that is not padding.
    """

    colors: Floats
    codes: Codes
    factor: float
    contrast: float
    window: tuple[int, int, int, int]

    def to_photo(self, points: Points) -> Points:
        """Photo pixels (N, 2) of reduced ones."""
        return from_resized(points, self.factor)

    def from_photo(self, points: Points) -> Points:
        """Reduced pixels (N, 2) of photo pixels."""
        return np.asarray((points + 0.5) * self.factor - 0.5)

    def window_of(self, shape: tuple[int, ...], factor: float) -> tuple[float, float, float, float]:
        """First and last pixels (x0, y0, x1, y1) without padding, in the photo resized by `factor` to `shape`."""
        scale = factor / self.factor
        x0, y0, x1, y1 = self.window
        height, width = self.colors.shape[:2]
        return (
            x0 * scale if x0 else 0.0,
            y0 * scale if y0 else 0.0,
            (x1 + 1) * scale - 1 if x1 < width - 1 else shape[1] - 1.0,
            (y1 + 1) * scale - 1 if y1 < height - 1 else shape[0] - 1.0,
        )


def reduce_photo(photo: RgbImage | Halves) -> ReducedPhoto:
    """Reduce `photo` (H, W, 3) to the size at which its sheet is searched."""
    halves = Halves.of(photo)
    height, width = halves.image.shape[:2]
    factor = min(1.0, GROUND_PX / max(height, width))
    small, _ = _halved(halves, 2 * GROUND_PX)
    small = _resized(small, round(width * factor), round(height * factor))
    size = (small.shape[1], small.shape[0])
    x0, y0, x1, y1 = window = _without_bands(small)
    side = max(int(CLOSING * max(size)) | 1, 3)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    # Padded, or a narrow strip of desk at the photo's border would be closed with the print.
    wide = cv2.copyMakeBorder(
        small[y0 : y1 + 1, x0 : x1 + 1], side, side, side, side, borderType=cv2.BORDER_REPLICATE
    )
    blank = cv2.morphologyEx(wide, cv2.MORPH_CLOSE, kernel)[side:-side, side:-side]
    closed = small.copy()
    closed[y0 : y1 + 1, x0 : x1 + 1] = cv2.medianBlur(np.ascontiguousarray(blank), 3)
    lab = cv2.cvtColor(closed.astype(np.float32) / np.float32(255), cv2.COLOR_RGB2LAB)
    colors = np.asarray(lab, np.float32)
    return ReducedPhoto(colors, color_codes(colors), factor, _edge_contrast(colors, window), window)


def medium_photo(photo: Halves) -> tuple[RgbImage, float]:
    """The photo (H, W, 3) with its print, at the size at which edges are followed, and its factor."""
    return _halved(photo, MEDIUM_LONG_SIDE_PX)


def _edge_contrast(colors: NDArray[Any], window: tuple[int, int, int, int]) -> float:
    """Colour difference on which an edge in `colors` (h, w, 3) counts half."""
    x0, y0, x1, y1 = window
    shown = np.asarray(cv2.blur(colors[y0 : y1 + 1, x0 : x1 + 1], (3, 3)))
    steps = [shown[3:, :-3] - shown[:-3, :-3], shown[:-3, 3:] - shown[:-3, :-3]]
    difference = np.maximum(*(length_of_channels(step) for step in steps))
    return float(np.clip(UNREST_FACTOR * percentile(difference.ravel(), UNREST_PERCENTILE), *CONTRAST))


def _halved(halves: Halves, long_side_px: int) -> tuple[RgbImage, float]:
    """The first of the `halves` whose long side is at most `long_side_px`, and its factor."""
    times = 0
    while max(halves.image.shape[:2]) >> times > long_side_px:
        times += 1
    return halves.halved(times), 0.5**times


def _resized(image: RgbImage, width: int, height: int) -> RgbImage:
    """`image` reduced by area averages."""
    size = (max(width, 8), max(height, 8))
    if size == (image.shape[1], image.shape[0]):
        return image
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _without_bands(small: RgbImage) -> tuple[int, int, int, int]:
    """First and last column and row that are not in a black band.

    Bands are as long as the photo and equally wide on both sides, and what follows them begins everywhere at once;
    a sheet on a black ground does not.
    """
    dark = strongest_channel(small) <= BAND_LEVEL
    x0, x1 = _trimmed(dark)
    y0, y1 = _trimmed(dark[:, x0 : x1 + 1].T)
    return x0, y0, x1, y1


def _trimmed(dark: Mask) -> tuple[int, int]:
    """First and last column of `dark` (rows, columns) that are not in a band."""
    count = dark.shape[1]
    lit = np.flatnonzero((~dark).any(axis=0))
    if not len(lit):
        return 0, count - 1
    # One column of mixed pixels lies between.
    first, last = int(lit[0]) + 1, int(lit[-1]) - 1
    widths = (first - 1, count - 2 - last)
    begins = [(~dark[:, at]).mean() >= BAND_SHARE for at in (min(first, last), max(first, last))]
    if min(widths) < 1 or abs(widths[0] - widths[1]) > BAND_DIFFERENCE or not all(begins):
        return 0, count - 1
    return first, last
