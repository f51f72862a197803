"""Composition of one page from many patches (4.4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import GrayImage, RgbImage
from services.contract.mosaic import Composition
from services.mosaic.composition.patch_blending import blend_patch
from services.mosaic.composition.patch_drawing import (
    DrawablePatch,
    FloatMap,
    Rectangle,
    map_nodes,
    prepare_patch,
)
from services.mosaic.composition.sharpness import (
    CellGrid,
    PatchMaps,
    choose_cells,
    measure_patch,
    print_sharpness,
)
from services.mosaic.composition.word_votes import decide_cells, decide_words, fade_weights, unite_ink
from services.mosaic.placed_photo import PlacedPhoto

# Sizes of tiles and of transitions.
FADE = 1.5
"""Width of the transition between two photos' backgrounds, text heights."""


@dataclass(frozen=True, slots=True, eq=False)
class ComposedPage:
    """The page (H, W, 3), white where no photo shows it, and the sharpness of each photo's print, in input order.

    Sharpness is relative to the sharpest photo: 0-1, 0 for a photo without print.
    """

    image: RgbImage
    sharpness: tuple[float, ...]


def compose_page(
    placed: Sequence[PlacedPhoto], width: int, height: int, composition: Composition, text_height_px: float
) -> ComposedPage:
    """The page of `width` x `height` mosaic pixels, composed from `placed`. Memory is limited apart from the page.

    Parameters
    ----------
    placed
        The placed photos.
    width, height
        Size of the page, mosaic pixels.
    composition
        `selective` takes each word from the photo that shows it sharpest (4.4). `average`, for comparison, is the mean
        of all photos, weighted by the distance to their borders (4.1).
    text_height_px
        Text height on the page, mosaic pixels.
    """
    patches = [prepare_patch(one, width, height) for one in placed]
    grid = choose_cells(width, height, text_height_px)
    maps = [measure_patch(patch, grid) for patch in patches]
    selective = composition == "selective"
    weights = select_photos(maps, grid) if selective else [_feather(patch) for patch in maps]
    image = _draw_page(patches, [patch.box for patch in maps], weights, grid)
    sharpness = [print_sharpness(patch) for patch in maps]
    sharpest = max([*sharpness, 1e-9])
    return ComposedPage(image, tuple(value / sharpest for value in sharpness))


def select_photos(maps: Sequence[PatchMaps], grid: CellGrid) -> list[GrayImage]:
    """Weights (0-255) of each photo in the cells of its box (4.4)."""
    ink = unite_ink(maps, grid.rows, grid.columns)
    cells = decide_cells(maps, ink, grid.text_height)
    decisions = decide_words(maps, ink, cells, grid.text_height)
    return fade_weights(maps, decisions, grid.text_height, FADE)


def _feather(patch: PatchMaps) -> GrayImage:
    """Weights that decrease towards the photo's border."""
    if patch.inset.size == 0:
        return np.zeros(patch.inset.shape, np.uint8)
    relative = patch.inset / max(float(patch.inset.max()), 1.0)
    return np.where(patch.covered > 0, 1 + np.round(254 * relative), 0).astype(np.uint8)


def _draw_page(
    patches: Sequence[DrawablePatch], boxes: Sequence[Rectangle], weights: Sequence[GrayImage], grid: CellGrid
) -> RgbImage:
    """Weighted mean of the patches, drawn tile by tile."""
    image = np.full((grid.height, grid.width, 3), 255, np.uint8)
    page = Rectangle(0, 0, grid.width, grid.height)
    for cells in grid.tiles(Rectangle(0, 0, grid.columns, grid.rows)):
        tile = grid.pixels(cells).meet(page)
        _draw_tile(patches, boxes, weights, grid, tile, image[tile.within(page)])
    return image


def _draw_tile(
    patches: Sequence[DrawablePatch],
    boxes: Sequence[Rectangle],
    weights: Sequence[GrayImage],
    grid: CellGrid,
    tile: Rectangle,
    into: RgbImage,
) -> None:
    """Draw the weighted mean in one tile. Only the part of a photo with a positive weight is drawn."""
    total = np.zeros(into.shape[:2], np.float32)
    for patch, box, weight in zip(patches, boxes, weights, strict=True):
        part = _weighted_part(box, weight, grid.cells(tile))
        pixels = grid.pixels(part).meet(tile)
        if pixels.width == 0 or pixels.height == 0:
            continue
        nodes = map_nodes(patch, pixels)
        if nodes is not None:
            at = pixels.within(tile)
            blend_patch(patch, nodes, _cells_around(box, weight, part), grid.side, into[at], total[at])


def _weighted_part(box: Rectangle, weight: GrayImage, cells: Rectangle) -> Rectangle:
    """The cells of the photo, among `cells`, around those where it has weight."""
    reach = Rectangle(cells.left - 1, cells.top - 1, cells.width + 2, cells.height + 2).meet(box)
    if reach.width == 0 or reach.height == 0:
        return Rectangle(cells.left, cells.top, 0, 0)
    x, y, width, height = cv2.boundingRect(weight[reach.within(box)])
    if width == 0 or height == 0:
        return Rectangle(cells.left, cells.top, 0, 0)
    return Rectangle(reach.left + x - 1, reach.top + y - 1, width + 2, height + 2).meet(cells)


def _cells_around(box: Rectangle, weight: GrayImage, part: Rectangle) -> FloatMap:
    """Weights of `part` and of one cell more on each side; 0 outside of the photo's box."""
    around = Rectangle(part.left - 1, part.top - 1, part.width + 2, part.height + 2)
    cells = np.zeros((around.height, around.width), np.float32)
    known = around.meet(box)
    cells[known.within(around)] = weight[known.within(box)]
    return cells
