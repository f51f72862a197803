"""Smooth gains that equalize the light of overlapping views (4.4)."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, GrayImage
from services.imaging.channels import only_where, strongest_channel
from services.mosaic.light.canvas import BLOCK_PX, CELL_PX, CanvasView, FloatImage
from services.robust import cauchy_weights

DARKEST = 16.0
"""Gray level below which a colour is only noise and the camera's black level."""

CLIPPED_LEVEL = 254
"""From this level on the camera may have clipped a colour; compression changes 255 by one."""
WIDER_WEIGHT = 0.01
"""Weight of a window over that of the next narrower one, so that the narrowest with data decides."""


# Lengths relative to a view's long side; gains are compared as logarithms.
NODES = 7
"""Nodes of the smooth field along the long side; they model vignetting to half a per cent."""
ROBUST_SCALE = 0.03
"""Scale of the Cauchy loss. Smooth changes of light leave smaller residuals; shadow edges and glare larger ones."""
ITERATIONS = 8
"""Iterations of reweighting; weights converge to a few per cent in six."""
CLOSING_PX = 15
"""Size of the morphological closing, canvas pixels: wider than a headline's strokes on a view of 600 pixels."""
BRIGHT_SHARE = 0.85
"""Light is compared where colours have at least this share of the largest brightness nearby. Ink is darker in a
sharp photo than in a blurred or hazy one, so it gives no information about light."""
SHOWN_SHARE = 0.7
"""Least share of a block that a photo shows: two photos see different parts of a half-shown block."""
CLIPPED_DISCOUNT = 0.9
"""Share of a block's weight that is lost where all of it is clipped: a clipped colour is a lower bound."""
LEAST_BRIGHT = 0.1
"""Least share of a block that is bright, and so shows the light."""
GAUGE = 1e-6
"""Weight of a prior of gain 1 at every node. It determines only what data leave free: the mean over all photos."""


def fit_light(views: Sequence[CanvasView]) -> list[Floats]:
    """Log gains (rows, columns, 3) of each view, at nodes that span its box corner to corner.

    The gains make overlapping views agree. They solve one robust least-squares problem over the colour ratios of all
    blocks that two views share, with a smoothness cost. The result does not depend on the order of the views.
    """
    shapes = [_node_shape(view.shown.shape, NODES) for view in views]
    starts = np.concatenate([[0], np.cumsum([rows * columns for rows, columns in shapes])])
    normal = np.zeros((starts[-1], starts[-1]))
    for shape, start, end in zip(shapes, starts[:-1], starts[1:], strict=True):
        # A twentieth of the weight of the blocks between the nodes: data decide where there are any.
        normal[start:end, start:end] = _roughness(*shape) + GAUGE * np.eye(end - start)
    pairs = _shared_blocks(views, shapes)
    logs: Floats = np.zeros((starts[-1], 3))
    for _ in range(ITERATIONS):
        A, b = normal.copy(), np.zeros_like(logs)
        for i, j, Bi, Bj, ratio, weight in pairs:
            si, sj = slice(starts[i], starts[i + 1]), slice(starts[j], starts[j + 1])
            residual = Bi @ logs[si] - Bj @ logs[sj] - ratio
            robust = weight * cauchy_weights(np.sqrt((residual**2).mean(axis=1)), ROBUST_SCALE)
            Wi, Wj = Bi.T * robust, Bj.T * robust
            A[si, si] += Wi @ Bi
            A[sj, sj] += Wj @ Bj
            cross = Wi @ Bj
            A[si, sj] -= cross
            A[sj, si] -= cross.T
            b[si] += Wi @ ratio
            b[sj] -= Wj @ ratio
        logs = np.linalg.solve(A, b)
    return [
        logs[start:end].reshape(*shape, 3)
        for shape, start, end in zip(shapes, starts[:-1], starts[1:], strict=True)
    ]


def _node_shape(shape: tuple[int, ...], nodes: int) -> tuple[int, int]:
    longest = max(shape[:2])
    rows, columns = (max(2, round((nodes - 1) * side / longest) + 1) for side in shape[:2])
    return rows, columns


def _roughness(rows: int, columns: int) -> Floats:
    """Quadratic form (N, N) of the differences between neighbouring nodes."""

    def along(count: int) -> Floats:
        difference = np.diff(np.eye(count), axis=0)
        return np.asarray(difference.T @ difference)

    return np.asarray(np.kron(along(rows), np.eye(columns)) + np.kron(np.eye(rows), along(columns)))


def _interpolation(count: int, nodes: int) -> Floats:
    """Linear interpolation (count, nodes), from nodes at both ends of a side to the centres of its `count` parts."""
    place = (np.arange(count) + 0.5) / count * (nodes - 1)
    return np.asarray(np.maximum(1 - np.abs(place[:, None] - np.arange(nodes)), 0))


def node_field(nodes: Floats, height: int, width: int) -> FloatImage:
    """Field (height, width, 3) float32 at pixels, bilinear between `nodes` as `fit_light` places them."""
    down, across = _interpolation(height, nodes.shape[0]), _interpolation(width, nodes.shape[1])
    return np.asarray(np.einsum("yr,xc,rck->yxk", down, across, nodes, optimize=True), np.float32)


def bright_parts(gray: FloatImage | GrayImage) -> FloatImage:
    """Mask (H, W) float: 1 where an image is about as bright as its surroundings, without ink, else 0.

    `gray` (H, W) is its strongest channel; bytes take a quarter of the time.
    """
    around = cv2.morphologyEx(gray, cv2.MORPH_CLOSE, np.ones((CLOSING_PX,) * 2, np.uint8))
    least = np.multiply(around, np.float32(BRIGHT_SHARE), dtype=np.float32)
    np.maximum(least, np.float32(DARKEST), out=least)
    return np.asarray(gray >= least, np.float32)


def _shared_blocks(
    views: Sequence[CanvasView], shapes: Sequence[tuple[int, int]]
) -> list[tuple[int, int, Floats, Floats, Floats, Floats]]:
    """For every two views with shared blocks: their indices, the interpolation (N, nodes) of the blocks in each view,
    the logarithm of the colour ratios (N, 3), and weights (N,)."""
    blocks = [_measure_blocks(view) for view in views]
    bases = [
        np.kron(_interpolation(color.shape[0], rows), _interpolation(color.shape[1], columns)).reshape(
            *color.shape[:2], rows * columns
        )
        for (color, _), (rows, columns) in zip(blocks, shapes, strict=True)
    ]
    pairs: list[tuple[int, int, Floats, Floats, Floats, Floats]] = []
    for j, second in enumerate(views):
        for i, first in enumerate(views[:j]):
            top, left = max(first.top, second.top), max(first.left, second.left)
            bottom = min(first.box[0].stop, second.box[0].stop)
            right = min(first.box[1].stop, second.box[1].stop)
            if bottom <= top or right <= left:
                continue
            parts = [
                np.s_[
                    (top - v.top) // BLOCK_PX : (bottom - v.top) // BLOCK_PX,
                    (left - v.left) // BLOCK_PX : (right - v.left) // BLOCK_PX,
                ]
                for v in (first, second)
            ]
            weight = np.minimum(blocks[i][1][parts[0]], blocks[j][1][parts[1]])
            known = weight > 0
            if not known.any():
                continue
            ratio = blocks[j][0][parts[1]][known] - blocks[i][0][parts[0]][known]
            pairs.append((i, j, bases[i][parts[0]][known], bases[j][parts[1]][known], ratio, weight[known]))
    return pairs


def _measure_blocks(view: CanvasView) -> tuple[Floats, Floats]:
    """Log colour (rows, columns, 3) of the bright parts of every block, and its weight, 0 if it is unknown."""
    strongest = strongest_channel(view.image.astype(np.uint8))  # levels of a view are whole
    bright = bright_parts(strongest) * view.shown
    size = (view.shown.shape[1] // BLOCK_PX, view.shown.shape[0] // BLOCK_PX)
    share = cv2.resize(bright, size, interpolation=cv2.INTER_AREA).astype(np.float64)
    shown = cv2.resize(view.shown.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    seen = only_where(bright > 0, view.image)
    color = cv2.resize(seen, size, interpolation=cv2.INTER_AREA).astype(np.float64)
    clipped = (strongest >= CLIPPED_LEVEL).astype(np.float32) * bright
    clipped_share = cv2.resize(clipped, size, interpolation=cv2.INTER_AREA) / np.maximum(share, 1e-6)
    weight = np.where(shown > SHOWN_SHARE, share * (1 - CLIPPED_DISCOUNT * clipped_share), 0.0)
    weight[share < LEAST_BRIGHT] = 0.0
    return np.log(np.maximum(color / np.maximum(share, 1e-6)[..., None], 1.0)), weight


def to_cells(image: FloatImage | NDArray[np.uint8]) -> FloatImage:
    """Means over the cells of an image; at least one cell remains."""
    size = (max(1, image.shape[1] // CELL_PX), max(1, image.shape[0] // CELL_PX))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)


def spread(weighted: FloatImage, weight: FloatImage, sigmas: Sequence[float]) -> FloatImage:
    """Smoothed means of `weighted` / `weight`, (H, W, C) and (H, W), with Gaussian windows of the given sizes.

    Each window has `WIDER_WEIGHT` times the weight of the previous one, so the narrowest window with data decides.
    The mean over the whole image comes last.
    """
    total = 1e-12 + float(weight.mean())
    share = np.full(weight.shape, total, np.float32)
    value = np.broadcast_to(weighted.mean(axis=(0, 1)), weighted.shape).astype(np.float32)
    for sigma in reversed(sigmas):
        share = share * WIDER_WEIGHT + _gaussian(weight, sigma)
        value = value * WIDER_WEIGHT + _gaussian(weighted, sigma)
    return np.asarray(value / share[..., None], np.float32)


def _gaussian(image: FloatImage, sigma: float) -> FloatImage:
    blurred = cv2.GaussianBlur(np.ascontiguousarray(image), (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(blurred, np.float32).reshape(image.shape)
