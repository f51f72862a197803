"""Drawing of one photo's part of the mosaic, a rectangle at a time, by one remap of the photo."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, Points, RgbImage
from services.geometry.homographies import to_resized
from services.imaging.bicubic import draw_by_map
from services.imaging.node_grid import (
    MAX_REDUCTION,
    between_nodes,
    continuous_nodes,
    node_grid,
    positive_between,
)
from services.imaging.reduction import LARGEST_STEP
from services.mosaic.flat_photo import RIM_PX
from services.mosaic.light.canvas import OUTSIDE_PX
from services.mosaic.light.tones import apply_tones, tone_factors
from services.mosaic.placed_photo import PlacedPhoto

FloatMap = NDArray[np.float32]
"""(H, W, ...) of pixels, or of cells."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Rectangle of pixels, or of cells, of the mosaic."""

    left: int
    top: int
    width: int
    height: int

    @property
    def right(self) -> int:
        """First column to its right."""
        return self.left + self.width

    @property
    def bottom(self) -> int:
        """First row below it."""
        return self.top + self.height

    def meet(self, other: "Rectangle") -> "Rectangle":
        """Intersection with `other`; its width and height are 0 if it is empty."""
        left, top = max(self.left, other.left), max(self.top, other.top)
        right, bottom = min(self.right, other.right), min(self.bottom, other.bottom)
        return Rectangle(left, top, max(right - left, 0), max(bottom - top, 0))

    def within(self, other: "Rectangle") -> tuple[slice, slice]:
        """Rows and columns of this rectangle in an array that spans `other`."""
        top, left = self.top - other.top, self.left - other.left
        return slice(top, top + self.height), slice(left, left + self.width)


@dataclass(frozen=True, slots=True, eq=False)
class DrawablePatch:
    """A placed photo with all that drawing needs.

    Attributes
    ----------
    placed : the photo and its placement.
    source : (h, w, 3) photo, reduced by area averages if it has more detail than the mosaic.
    factor : source pixels per photo pixel, 0-1.
    box : rectangle of the page that contains all that the photo shows.
    is_toned : whether its tones change any colour.
    """

    placed: PlacedPhoto
    source: RgbImage
    factor: float
    box: Rectangle
    is_toned: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class PatchNodes:
    """Values (rows, columns, ...) float32 at the nodes of a rectangle of the mosaic, see `node_grid`.

    `source` (..., 2) are source pixels; `inside` (..., 4) are distances from the borders of the photo and of its flat
    view, of which one is negative where the photo shows nothing; `flat` (rows * columns, 2) are flat pixels.
    """

    source: NDArray[np.float32]
    inside: NDArray[np.float32]
    flat: Points


@dataclass(frozen=True, slots=True, eq=False)
class PatchMap:
    """Source points of a rectangle of the mosaic.

    `source` (H, W, 2) float32 are source pixels; `covered` (H, W) is 255 where the photo shows the page, 0 elsewhere.
    """

    source: NDArray[np.float32]
    covered: GrayImage
    nodes: PatchNodes


def prepare_patch(placed: PlacedPhoto, width: int, height: int) -> DrawablePatch:
    """`placed`, prepared for drawing on a page of `width` x `height` mosaic pixels."""
    shown = np.asarray(placed.flat.shown, np.uint8) * np.uint8(255)
    points = _outline(shown)
    if len(points) == 0:
        return DrawablePatch(placed, placed.flat.photo, 1.0, Rectangle(0, 0, 0, 0))
    mosaic = placed.placement.to_mosaic(points)
    low = np.floor(np.clip(mosaic.min(axis=0), 0, [width, height])).astype(int)
    high = np.ceil(np.clip(mosaic.max(axis=0) + 1, 0, [width, height])).astype(int)
    box = Rectangle(int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1]))
    inside = _grid_inside(placed, shown)
    detail = float(np.median(_enlargement(placed.to_photo, inside)))
    factor = 1.0 / detail if np.isfinite(detail) and detail > LARGEST_STEP else 1.0
    source = placed.flat.photo
    if factor < 1.0:
        size = (max(round(source.shape[1] * factor), 1), max(round(source.shape[0] * factor), 1))
        source = np.asarray(cv2.resize(source, size, interpolation=cv2.INTER_AREA), np.uint8)
    is_toned = bool((placed.tones.coefficients != np.array([1, 1, 1, 1, 0, 0], np.float32)).any())
    return DrawablePatch(placed, source, factor, box, is_toned)


def map_nodes(patch: DrawablePatch, rectangle: Rectangle) -> PatchNodes | None:
    """Where `rectangle` of the mosaic is seen, at its nodes; None if the photo shows nothing of it."""
    nodes, shape = node_grid(rectangle.left, rectangle.top, rectangle.width, rectangle.height)
    flat = patch.placed.placement.to_flat(nodes)
    photo = patch.placed.flat.to_photo(flat)
    known = continuous_nodes(photo.reshape(*shape, 2), MAX_REDUCTION)
    known &= np.isfinite(flat).all(axis=1).reshape(shape)
    if not known.any():
        return None
    photo_size, flat_size = np.array(patch.placed.flat.photo.shape[1::-1]), np.array(patch.placed.flat.size)
    scale = np.array(patch.source.shape[1::-1]) / photo_size
    source = to_resized(np.where(known.reshape(-1, 1), photo, OUTSIDE_PX), scale)
    # Distances from the photo's border and, to the ends of its pixels, from that of the flat view.
    inside = np.hstack(
        [
            (photo_size - 1) / 2 - RIM_PX - np.abs(photo - (photo_size - 1) / 2),
            flat_size / 2 - np.abs(flat - (flat_size - 1) / 2),
        ]
    ).reshape(*shape, 4)
    inside[~known] = OUTSIDE_PX
    if (inside.max(axis=(0, 1)) < 0).any():
        return None
    return PatchNodes(
        source.reshape(*shape, 2).astype(np.float32),
        inside.astype(np.float32),
        np.where(np.isfinite(flat), flat, 0.0),
    )


def map_patch(patch: DrawablePatch, rectangle: Rectangle) -> PatchMap | None:
    """Source points of `rectangle` of the mosaic; None if the photo shows nothing of it."""
    nodes = map_nodes(patch, rectangle)
    return None if nodes is None else map_between(nodes, rectangle.width, rectangle.height)


def map_between(nodes: PatchNodes, width: int, height: int) -> PatchMap | None:
    """Source points between `nodes`, of `width` x `height` pixels; None if the photo shows nothing there."""
    shown = positive_between(nodes.inside, width, height)
    if not shown.any():
        return None
    return PatchMap(between_nodes(nodes.source, width, height), shown.view(np.uint8) * np.uint8(255), nodes)


def draw_patch(patch: DrawablePatch, patch_map: PatchMap) -> RgbImage:
    """The patch in colour, with its tones applied. Pixels outside of `covered` must not be used."""
    seen_at = patch_map.source
    drawn = np.empty((*seen_at.shape[:2], 3), np.uint8)
    draw_by_map(patch.source, drawn, seen_at[..., 0], seen_at[..., 1], beyond=None)
    if not patch.is_toned:
        return drawn
    height, width = drawn.shape[:2]
    return apply_tones(
        drawn, [between_nodes(plane, width, height) for plane in tones_at(patch, patch_map.nodes)]
    )


def tones_at(patch: DrawablePatch, nodes: PatchNodes) -> list[NDArray[np.float32]]:
    """The five factors of `apply_tones`, each (rows, columns), at the nodes."""
    rows, columns = nodes.source.shape[:2]
    return tone_factors(patch.placed.tones.at(nodes.flat).reshape(rows, columns, 6))


def _outline(shown: GrayImage) -> Points:
    """Points (N, 2) around the shown part."""
    contours, _ = cv2.findContours(shown, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    if not contours:
        return np.empty((0, 2))
    return np.concatenate([contour.reshape(-1, 2) for contour in contours]).astype(np.float64)


def _grid_inside(placed: PlacedPhoto, shown: GrayImage, count: int = 24) -> Points:
    """Mosaic points (N, 2) on a grid over the shown part."""
    height, width = shown.shape
    grid = np.stack(
        np.meshgrid(np.linspace(0, width - 1, count), np.linspace(0, height - 1, count)), axis=-1
    ).reshape(-1, 2)
    at = np.round(grid).astype(int)
    kept = grid[shown[at[:, 1], at[:, 0]] > 0]
    return placed.placement.to_mosaic(kept if len(kept) else grid)


def _enlargement(to: Callable[[Points], Points], mosaic: Points) -> NDArray[np.float64]:
    """Linear enlargement (N,) of the map `to` at points (N, 2): the square root of the area of one mosaic pixel."""
    here, steps = to(mosaic), np.eye(2)
    right, down = to(mosaic + steps[0]) - here, to(mosaic + steps[1]) - here
    return np.sqrt(np.abs(right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0]))
