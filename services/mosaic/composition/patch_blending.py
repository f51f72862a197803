"""Photos drawn onto the page, each where cells of the page give it weight."""

import ctypes

import cv2
import numpy as np

from services.arrays import RgbImage
from services.imaging.bicubic import bicubic_weights
from services.imaging.node_grid import node_count
from services.kernels.library import KernelPatch, address, find_kernels, image_of, is_packed
from services.mosaic.composition.patch_drawing import (
    DrawablePatch,
    FloatMap,
    PatchNodes,
    draw_patch,
    map_between,
    tones_at,
)


def blend_patch(
    patch: DrawablePatch, nodes: PatchNodes, cells: FloatMap, side: int, into: RgbImage, total: FloatMap
) -> None:
    """Draw the part of `patch` that `nodes` map, in place, into the mean of the photos that are drawn already.

    `into` (H, W, 3) is that mean, and `total` (H, W) float32 the sum of their weights. Those of this photo are given in
    `cells`, squares of `side` pixels, one more on each side than `into` has, and are bilinear between their centres.
    Where the photo shows nothing its weight is 0.
    """
    height, width = into.shape[:2]
    if nodes.source.shape[:2] != node_count(width, height) or total.shape != (height, width):
        raise ValueError("the nodes are those round what is drawn, and the weights those of its pixels")
    rows, columns = cells.shape
    if (rows - 2) * side < height or (columns - 2) * side < width:
        raise ValueError("the cells are those of what is drawn, and one more on each side")
    kernels = find_kernels()
    if kernels is None or not is_packed(patch.source) or not is_packed(into):
        blend_patch_plain(patch, nodes, cells, side, into, total)
        return
    tones = np.dstack(tones_at(patch, nodes)) if patch.is_toned else np.zeros((*nodes.source.shape[:2], 0))
    values = np.concatenate([nodes.source, nodes.inside, tones], axis=2, dtype=np.float32)
    weights = np.ascontiguousarray(cells, np.float32)
    drawn = KernelPatch(
        address(values),
        address(weights),
        address(total),
        total.strides[0] // total.itemsize,
        *values.shape[1:],
        weights.shape[1],
        side,
    )
    source, target = ctypes.byref(image_of(patch.source)), ctypes.byref(image_of(into))
    if not kernels.blend_patch(source, target, address(bicubic_weights()), ctypes.byref(drawn)):
        raise MemoryError


def blend_patch_plain(
    patch: DrawablePatch, nodes: PatchNodes, cells: FloatMap, side: int, into: RgbImage, total: FloatMap
) -> None:
    """`blend_patch` by OpenCV: no pixel differs by more than one gray level."""
    height, width = into.shape[:2]
    found = map_between(nodes, width, height)
    if found is None:
        return
    size = (cells.shape[1] * side, cells.shape[0] * side)
    dense = cv2.resize(cells, size, interpolation=cv2.INTER_LINEAR)
    share = np.ascontiguousarray(dense[side:, side:][:height, :width])
    share[found.covered == 0] = 0
    drawn = draw_patch(patch, found)
    mixed = cv2.blendLinear(into, drawn, total, share) if total.any() else drawn
    into[:] = cv2.copyTo(mixed, np.asarray(share > 0).view(np.uint8), into)
    total += share
