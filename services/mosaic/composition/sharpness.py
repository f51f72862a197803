"""Sharpness of the print in each photo, on a reduced map of the mosaic (4.4).

Photos are compared in *cells*, which are squares of mosaic pixels. Gradients and the exact borders of photos need full
resolution. They are measured tile by tile, and only their means are kept.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import GrayImage
from services.imaging.channels import luminance, only_where
from services.mosaic.composition.cell_measures import CellMeasures, measure_cells
from services.mosaic.composition.patch_drawing import DrawablePatch, FloatMap, Rectangle, map_nodes
from services.mosaic.composition.related_cells import (
    masked_means,
    masked_medians,
    raise_strength,
    relate_cells,
    remove_noise,
)

# Lengths in text heights; brightness relative to the bare paper.
CELLS_PER_TEXT_HEIGHT = 9.0
"""A stroke is then about one cell wide, and the gap between two text lines a few cells."""
MOST_CELLS = 3e6
"""Largest number of cells of a page; limits the memory of all maps."""
TILE_PX = (1024, 3072)
"""Rows and columns of the pieces in which photos are measured and drawn. Kernels go row by row, and each piece costs
the time to map its nodes."""
WINDOW = 2.5
"""Window, wider than any stroke of text, whose brightest pixels are paper, and over which sharpness is averaged: focus
varies slowly and print varies fast."""
INK_CONTRAST = 0.1
"""Least contrast of print: mean darkness of a cell relative to paper. Show-through has less."""
INK_GRADIENT = 0.04
"""Least RMS gradient of print per mosaic pixel. Light print and pictures have more, paper has less."""
INK_SHARE = 0.25
"""Least contrast and gradient relative to the strongest print within a text height. Weaker cells are the blurred
border of that print and would connect words."""
NOISE_FACTOR = 3.0
"""Least gradient of print relative to the gradient of bare paper."""
HIDDEN = np.uint8(1)
"""Share of a hidden cell that a photo shows, of 255."""
LEAST_PRINT = 0.005
"""Added to the share of print in a window: with less print than this there is no comparison."""


@dataclass(frozen=True, slots=True)
class CellGrid:
    """The page of `width` x `height` mosaic pixels, divided into square cells of `side` pixels."""

    width: int
    height: int
    side: int
    text_height: float
    """Text height in cells."""

    @property
    def columns(self) -> int:
        """Number of cells across; the last one may extend beyond the page."""
        return -(-self.width // self.side)

    @property
    def rows(self) -> int:
        """Number of cells down; the last one may extend beyond the page."""
        return -(-self.height // self.side)

    def cells(self, pixels: Rectangle) -> Rectangle:
        """The cells that overlap `pixels`."""
        left, top = pixels.left // self.side, pixels.top // self.side
        right, bottom = -(-pixels.right // self.side), -(-pixels.bottom // self.side)
        if pixels.width == 0 or pixels.height == 0:
            return Rectangle(left, top, 0, 0)
        return Rectangle(left, top, right - left, bottom - top)

    def tiles(self, cells: Rectangle) -> Iterator[Rectangle]:
        """The pieces in which `cells` are measured or drawn; the last ones reach beyond."""
        rows, columns = (max(side // self.side, 1) for side in TILE_PX)
        for top in range(cells.top, cells.bottom, rows):
            for left in range(cells.left, cells.right, columns):
                yield Rectangle(left, top, columns, rows)

    def pixels(self, cells: Rectangle) -> Rectangle:
        """The pixels of `cells`."""
        return Rectangle(
            cells.left * self.side, cells.top * self.side, cells.width * self.side, cells.height * self.side
        )


@dataclass(frozen=True, slots=True, eq=False)
class PatchMaps:
    """Maps of one photo, in cells.

    Attributes
    ----------
    box : rectangle of the mosaic's cells that the maps cover.
    covered : 255 where the photo shows the whole cell, 0 where it shows nothing of it, 1 where it is hidden: the photo
        is used there if no other shows more.
    ink : strength of print relative to the strongest print within a text height (255); 0 without print.
    energy : (rows, columns, 2) mean squared gradient of brightness relative to paper, per mosaic pixel, across and
        down, minus that of noise.
    inset : distance to the next cell that is not completely shown, cells.
    """

    box: Rectangle
    covered: GrayImage
    ink: GrayImage
    energy: FloatMap
    inset: FloatMap


def choose_cells(width: int, height: int, text_height_px: float) -> CellGrid:
    """Grid of cells fine enough to separate text of `text_height_px` mosaic pixels from its background."""
    fine = max(1, round(text_height_px / CELLS_PER_TEXT_HEIGHT))
    side = max(fine, int(np.ceil(np.sqrt(width * height / MOST_CELLS))))
    return CellGrid(width, height, side, max(text_height_px / side, 1.0))


def measure_patch(patch: DrawablePatch, grid: CellGrid) -> PatchMaps:
    """The maps of one photo, measured in gray, tile by tile."""
    box = grid.cells(patch.box)
    measured = CellMeasures.nothing(box.height, box.width)
    gray_source = luminance(patch.source)
    for piece in grid.tiles(box):
        cells = piece.meet(box)
        tile = grid.pixels(cells)
        # One extra pixel on each side, for the gradient.
        nodes = map_nodes(patch, Rectangle(tile.left - 1, tile.top - 1, tile.width + 2, tile.height + 2))
        if nodes is not None:
            measure_cells(gray_source, nodes, grid.side, measured.part(cells.within(box)))
    for part in (patch.placed.hidden, patch.placed.yielding):
        if part is not None and part.cells.any():
            first = grid.pixels(box)
            there = part.over(first.left, first.top, grid.side, box.width, box.height)
            measured.covered[there] = np.minimum(measured.covered[there], HIDDEN)
    return _relate_to_paper(box, measured, grid.text_height)


def compare_sharpness(maps: PatchMaps, ink: GrayImage, text_height: float) -> FloatMap:
    """Gradient of the print around each cell of `maps.box`; near 0 where nothing is printed.

    It is the geometric mean of the RMS gradients across and down: print that is viewed obliquely, or blurred by motion,
    is sharp in one direction only, and unreadable. `ink` (rows, columns) is the print of all photos together, so that
    all photos are compared at the same places.
    """
    printed = ink[maps.box.within(Rectangle(0, 0, ink.shape[1], ink.shape[0]))]
    asked = (printed > 0) & (maps.covered == 255)
    share = _average(asked.astype(np.float32), WINDOW * text_height)
    total = _average(only_where(asked, maps.energy), WINDOW * text_height)
    both = np.maximum(total[..., 0] * total[..., 1], 0) / np.square(share + np.float32(LEAST_PRINT))
    return np.asarray(np.sqrt(np.sqrt(both)), np.float32)


def print_sharpness(maps: PatchMaps) -> float:
    """Sharpness of all print of the photo, as in `compare_sharpness`; 0 without print."""
    printed = (maps.ink > 0) & (maps.covered == 255)
    return float(np.prod(masked_means(maps.energy, printed)) ** 0.25) if printed.any() else 0.0


def _relate_to_paper(box: Rectangle, measured: CellMeasures, text_height: float) -> PatchMaps:
    """Brightness and gradients relative to the paper, so that light and exposure have no effect."""
    covered, gray, energy = measured.covered, measured.gray, measured.energy
    if covered.size == 0:
        return PatchMaps(box, covered, gray, energy, energy[..., 0])
    shown = covered == 255
    side = 2 * round(0.5 * WINDOW * text_height) + 1
    kernel = np.ones((side, side), np.uint8)
    brightest = cv2.dilate(only_where(shown, gray), kernel)
    elsewhere = np.where(shown, np.uint8(0), np.uint8(255))
    paper = cv2.erode(cv2.max(brightest, elsewhere), kernel).astype(np.float32)
    weight = shown.astype(np.float32)
    window = WINDOW * text_height
    light, known = (_average(each, window) for each in (paper * weight, weight))
    related = relate_cells(gray, energy, shown, light, known, 1 - 0.5 * INK_CONTRAST)
    near = np.ones((2 * round(0.5 * text_height) + 1,) * 2, np.uint8)
    noise = masked_medians(related.energy, related.bare)
    least = max(INK_GRADIENT, NOISE_FACTOR * sum(noise.tolist()) ** 0.5)
    ink = np.zeros(covered.shape, np.uint8)
    for values, smallest in ((related.darkness, INK_CONTRAST), (related.slope, least)):
        raise_strength(values, np.asarray(cv2.dilate(values, near), np.float32), smallest, INK_SHARE, ink)
    remove_noise(related.energy, noise)
    # Outside of its box the photo shows nothing; outside of the page nothing is needed.
    inset = cv2.distanceTransform(np.pad(shown.astype(np.uint8), 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
    return PatchMaps(box, covered, ink, related.energy, np.ascontiguousarray(inset))


def _average(values: FloatMap, window: float) -> FloatMap:
    """Mean within about `window` cells, by two box filters; the outside of the image counts as zero."""
    side = 2 * round(0.5 * window) + 1
    once = cv2.blur(values, (side, side), borderType=cv2.BORDER_CONSTANT)
    return np.asarray(cv2.blur(once, (side, side), borderType=cv2.BORDER_CONSTANT), np.float32)
