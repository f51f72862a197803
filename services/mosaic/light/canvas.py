"""Reduced views of photos in the mosaic's frame, to compare their light."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, RgbImage
from services.geometry.homographies import from_resized, to_resized
from services.imaging.node_grid import GRID_STEP_PX, between_nodes, node_grid, take_values
from services.imaging.reduction import reduce_image
from services.mosaic.flat_photo import RIM_PX, FlatPhoto
from services.mosaic.placing.placement import Placement

FloatImage = NDArray[np.float32]
"""(H, W) or (H, W, 3) float32."""

CELL_PX = 4
"""Side of a cell, canvas pixels; light is measured per cell."""
BLOCK_PX = 24
"""Side of a block, canvas pixels. Views start and end at blocks, so that the cells of all views coincide."""
LARGEST_SIDE_PX = 2400
"""Largest side of the canvas, for any number and size of photos."""

BORDER_POINTS = 9
"""Points along each side of a view that give its extent on the mosaic."""
OUTSIDE_PX = -1e6
"""Place of points that a photo does not show: outside of it, also after interpolation."""


@dataclass(frozen=True, slots=True)
class Canvas:
    """The reduced mosaic: canvas pixel p shows mosaic pixel (p + 1/2) / scale - 1/2 + origin."""

    scale: float
    origin: tuple[float, float]
    width: int
    height: int

    def to_mosaic(self, pixels: Points) -> Points:
        """Mosaic pixels (N, 2) of canvas pixels (N, 2)."""
        return np.asarray(from_resized(pixels, self.scale) + self.origin)

    def from_mosaic(self, mosaic: Points) -> Points:
        """Canvas pixels (N, 2) of mosaic pixels (N, 2)."""
        return np.asarray((mosaic - np.asarray(self.origin) + 0.5) * self.scale - 0.5)


@dataclass(frozen=True, slots=True, eq=False)
class CanvasView:
    """One photo on the canvas, in a box whose corner and sides are multiples of `BLOCK_PX`.

    Attributes
    ----------
    left, top : canvas pixel of the view's first pixel.
    image : (h, w, 3) float32, 0-255.
    shown : (h, w) true where the photo shows the page.
    feather : (h, w) distance to the border of the shown part, pixels; 0 outside of it.
    """

    left: int
    top: int
    image: FloatImage
    shown: Mask
    feather: FloatImage

    @property
    def box(self) -> tuple[slice, slice]:
        """Rows and columns of the view in the canvas."""
        height, width = self.shown.shape
        return slice(self.top, self.top + height), slice(self.left, self.left + width)


def frame_canvas(
    photos: Sequence[FlatPhoto], placements: Sequence[Placement], view_long_side_px: int
) -> tuple[Canvas, list[tuple[int, int, int, int]]]:
    """A canvas on which a photo's long side has the given length, and each photo's box: left, top, right, bottom."""
    outlines = [
        place.to_mosaic(_border(*photo.size)) for photo, place in zip(photos, placements, strict=True)
    ]
    low = np.array([outline.min(axis=0) for outline in outlines]) - 0.5
    high = np.array([outline.max(axis=0) for outline in outlines]) + 0.5
    origin = low.min(axis=0)
    extent = float((high.max(axis=0) - origin).max())
    typical = float(np.median((high - low).max(axis=1)))
    scale = min(view_long_side_px / typical, LARGEST_SIDE_PX / extent, 1.0)
    first = np.floor((low - origin) * scale / BLOCK_PX).astype(int) * BLOCK_PX
    last = np.maximum(np.ceil((high - origin) * scale / BLOCK_PX).astype(int) * BLOCK_PX, first + BLOCK_PX)
    width, height = last.max(axis=0)
    boxes = [(int(a[0]), int(a[1]), int(b[0]), int(b[1])) for a, b in zip(first, last, strict=True)]
    return Canvas(scale, (float(origin[0]) + 0.5, float(origin[1]) + 0.5), int(width), int(height)), boxes


def _border(width: int, height: int) -> Points:
    """Points along the border of a view of the given size."""
    x, y = np.linspace(0, width - 1, BORDER_POINTS), np.linspace(0, height - 1, BORDER_POINTS)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    return np.concatenate([grid[0], grid[-1], grid[1:-1, 0], grid[1:-1, -1]])


def draw_on_canvas(
    photo: FlatPhoto, placement: Placement, canvas: Canvas, box: tuple[int, int, int, int]
) -> CanvasView:
    """View of `photo` in `box` of the canvas."""
    left, top, right, bottom = box
    width, height = right - left, bottom - top
    nodes, shape = node_grid(left, top, width, height)
    flat = placement.to_flat(canvas.to_mosaic(nodes))
    image, within = draw_reduced(photo, flat, width, height)
    places = between_nodes(flat.reshape(*shape, 2).astype(np.float32), width, height)
    on_page = take_values(photo.shown.view(np.uint8), places, cv2.INTER_NEAREST, cv2.BORDER_CONSTANT)
    shown = without_rim(within, np.asarray(on_page, np.uint8))
    padded = np.pad(shown.view(np.uint8), 1)
    feather = cv2.distanceTransform(padded, cv2.DIST_L2, 3)[1:-1, 1:-1]
    return CanvasView(left, top, image.astype(np.float32), shown, np.asarray(feather, np.float32))


def draw_reduced(
    photo: FlatPhoto, flat_nodes: Points, width: int, height: int
) -> tuple[RgbImage, NDArray[np.uint8]]:
    """A small view (height, width, 3) of `photo`, whose nodes show the flat pixels `flat_nodes` (N, 2), and a mask of
    what lies within the photo, 0 elsewhere.

    The photo is first reduced by area averages to the view's resolution, to avoid aliasing.
    """
    _, (rows, columns) = node_grid(0, 0, width, height)
    seen = photo.to_photo(flat_nodes).reshape(rows, columns, 2)
    seen = np.where(np.isfinite(seen).all(axis=-1, keepdims=True), seen, OUTSIDE_PX)
    steps = np.linalg.norm(np.diff(seen, axis=1), axis=-1)
    within = _inside(seen[:, 1:], photo.photo.shape) & _inside(seen[:, :-1], photo.photo.shape)
    step = float(np.median(steps[within])) / GRID_STEP_PX if within.any() else 1.0
    factor = min(1.0, 1.0 / max(step, 1e-6))
    source = reduce_image(photo.photo, factor, fine=False)
    size = np.array(source.shape[1::-1])
    ratio = size / photo.photo.shape[1::-1]
    dense = between_nodes(to_resized(seen, ratio).astype(np.float32), width, height)
    image = take_values(source, dense, cv2.INTER_LINEAR, cv2.BORDER_REPLICATE)
    return np.asarray(image, np.uint8), np.asarray(cv2.inRange(dense, np.zeros(2), size - 1.0), np.uint8)


def without_rim(within: NDArray[np.uint8], on_page: NDArray[np.uint8]) -> Mask:
    """What of a view lies `within` the photo and `on_page` (h, w), without a border that mixes with the outside."""
    rim = np.ones((2 * RIM_PX + 1,) * 2, np.uint8)
    both = cv2.copyTo(within, on_page)
    return np.asarray(cv2.erode(both, rim, borderType=cv2.BORDER_REPLICATE) > 0)


def _inside(points: Floats | FloatImage, shape: tuple[int, ...]) -> Mask:
    """Which of `points` (..., 2) lie in an image of the given shape."""
    x, y = points[..., 0], points[..., 1]
    return np.asarray((x >= 0) & (y >= 0) & (x <= shape[1] - 1) & (y <= shape[0] - 1))
