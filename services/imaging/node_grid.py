"""Maps that are exact on a grid of nodes and bilinear between them."""

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points

GRID_STEP_PX = 16
"""A page's map is exact at every 16th output pixel: one that bends with a radius of a thousand pixels is then drawn
within 0.03 pixels."""
MAX_REDUCTION = 12.0
"""Most photo pixels per pixel of a page along one axis: a page needs fewer."""
TILE_NODES = 16
"""Nodes of the grid along the side of a tile in which the place is sought where values between them become negative."""
FAR_PX = 1e6
"""Outside of any image, and of any view: its paper has no corners farther away."""
ALL_KNOWN = 1 - 0.5 / (2 * GRID_STEP_PX) ** 2
"""Share of known nodes round a pixel: one that is not counts with the square of half a pixel's share of a step at
least."""
_NO_SECOND_MAP: Any = None
"""OpenCV's own annotations demand one; an empty array is not the same, it gives wrong values."""


def node_count(width: int, height: int) -> tuple[int, int]:
    """Rows and columns of the nodes round a rectangle."""
    return -(-height // GRID_STEP_PX) + 2, -(-width // GRID_STEP_PX) + 2


def node_grid(left: int, top: int, width: int, height: int) -> tuple[Points, tuple[int, int]]:
    """Nodes (N, 2) round the rectangle, in its image's pixels, row by row; and their rows and columns."""
    rows, columns = node_count(width, height)
    x = left + (np.arange(columns) - 0.5) * GRID_STEP_PX - 0.5
    y = top + (np.arange(rows) - 0.5) * GRID_STEP_PX - 0.5
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), (rows, columns)


def band_nodes(top: int, height: int) -> slice:
    """Rows of a whole image's `node_grid` round its pixel rows from `top` on; `top` is a multiple of the step."""
    return slice(top // GRID_STEP_PX, -(-(top + height) // GRID_STEP_PX) + 2)


def between_nodes(nodes: NDArray[np.float32], width: int, height: int) -> NDArray[np.float32]:
    """Values (height, width, ...) at the rectangle's pixels from those (rows, columns, ...) at its nodes."""
    size = (nodes.shape[1] * GRID_STEP_PX, nodes.shape[0] * GRID_STEP_PX)
    dense = cv2.resize(nodes, size, interpolation=cv2.INTER_LINEAR)
    # The first node is half a step before the rectangle, and values begin half a step before the first node.
    return np.asarray(dense[GRID_STEP_PX:, GRID_STEP_PX:][:height, :width], np.float32)


def maps_between(
    nodes: NDArray[np.float32], width: int, height: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """x and y (height, width) between `nodes` (rows, columns, 2); far away next to one that is NaN."""
    known = np.asarray(np.isfinite(nodes).all(axis=-1))
    filled: NDArray[np.float32] = np.nan_to_num(nodes)
    x, y = (between_nodes(filled[..., axis], width, height) for axis in (0, 1))
    if not known.all():
        x[between_nodes(known.astype(np.float32), width, height) < ALL_KNOWN] = -FAR_PX
    return x, y


def negative_tiles(
    nodes: NDArray[np.float32], width: int, height: int
) -> Iterator[tuple[tuple[slice, slice], Mask | None]]:
    """Tiles of the rectangle with negative values between `nodes` (rows, columns): rows and columns of each, and where.

    None: everywhere. Most tiles lie wholly on one side of 0, and need no values between the nodes.
    """
    step = TILE_NODES * GRID_STEP_PX
    for top in range(0, height, step):
        for left in range(0, width, step):
            row, column = top // GRID_STEP_PX, left // GRID_STEP_PX
            near = nodes[row : row + TILE_NODES + 2, column : column + TILE_NODES + 2]
            tile = slice(top, min(top + step, height)), slice(left, min(left + step, width))
            if near.max() < 0:
                yield tile, None
            elif near.min() < 0:
                size = tile[1].stop - left, tile[0].stop - top
                yield tile, np.asarray(between_nodes(near, *size) < 0)


def positive_between(nodes: Floats, width: int, height: int) -> Mask:
    """Where none of the K values between `nodes` (rows, columns, K) is negative, at the rectangle's pixels."""
    positive = np.ones((height, width), bool)
    for values in np.moveaxis(nodes.astype(np.float32), -1, 0):
        for tile, where in negative_tiles(values, width, height):
            positive[tile][... if where is None else where] = False
    return positive


def take_values(
    image: NDArray[Any], at: NDArray[np.float32], interpolation: int, border: int, outside: float = 0.0
) -> NDArray[Any]:
    """Values (H, W, ...) of `image` at its pixels `at` (H, W, 2), (x, y); `border` is OpenCV's mode beyond its edges.

    OpenCV takes both coordinates in one array, so that they need not be split.
    """
    return np.asarray(cv2.remap(image, at, _NO_SECOND_MAP, interpolation, None, border, outside))


def continuous_nodes(nodes: Floats, max_reduction: float) -> NDArray[np.bool_]:
    """Nodes (rows, columns) that are known, and where the map makes at most `max_reduction` of a step.

    Where the page's model ends, at crossing rulings or edge-on, its map leaps.
    """
    limit = max_reduction * GRID_STEP_PX
    known = np.asarray(np.isfinite(nodes).all(axis=-1))
    with np.errstate(invalid="ignore"):
        # NumPy's norm along so short an axis takes three times as long.
        down, across = (
            np.sqrt(x * x + y * y) > limit
            for x, y in (np.moveaxis(np.diff(nodes, axis=axis), -1, 0) for axis in (0, 1))
        )
    known[:-1] &= ~down
    known[1:] &= ~down
    known[:, :-1] &= ~across
    known[:, 1:] &= ~across
    return known
