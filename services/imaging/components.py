"""Connected components of a mask."""

import ctypes
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Mask, Points
from services.kernels.library import address, find_kernels, image_of

USUAL_COMPONENTS = 1 << 14
"""Of a page there are seldom more: then they are counted twice."""


class Components(NamedTuple):
    """Components of a mask (H, W), joined along sides and corners; number 0 is the ground.

    There are `total` with the ground. `labels` (H, W) is the number of the component of each pixel. Of each number,
    `stats` (N, 5) has left, top, width, height and area, as OpenCV's `CC_STAT_...`, and `centres` (N, 2) the mean
    (x, y) of its pixels. The ground's box is the whole mask.
    """

    total: int
    labels: NDArray[np.int32]
    stats: NDArray[np.int32]
    centres: Points


def label_components(mask: Mask | NDArray[np.uint8]) -> Components:
    """Components of `mask` (H, W), non-zero inside.

    OpenCV numbers them, by blocks of 2 x 2 pixels. They are measured by their runs along rows: OpenCV adds up all
    pixels of the mask one by one, which takes three times as long as all else.
    """
    inside = np.asarray(mask if mask.dtype == np.bool_ else mask != 0, np.bool_)
    count, found = cv2.connectedComponentsWithAlgorithm(
        np.ascontiguousarray(inside).view(np.uint8), 8, cv2.CV_32S, cv2.CCL_BBDT
    )
    labels = np.asarray(found, np.int32)
    y, first, last = runs_along_rows(inside)
    own = labels[y, first]
    length = last - first + 1
    area = np.bincount(own, length, count)
    left, right = np.full(count, mask.shape[1]), np.full(count, -1)
    np.minimum.at(left, own, first)
    np.maximum.at(right, own, last)
    # Runs are in the order of their rows: of one component's, the first and the last are assigned last.
    top, bottom = np.zeros(count, np.intp), np.zeros(count, np.intp)
    top[own[::-1]], bottom[own] = y[::-1], y
    sums = np.stack(
        [np.bincount(own, weights, count) for weights in (length * (first + last) / 2, length * y)]
    )
    height, width = mask.shape
    left[0], right[0], top[0], bottom[0] = 0, width - 1, 0, height - 1
    area[0] = mask.size - area.sum()
    sums[:, 0] = np.array([width - 1, height - 1]) * mask.size / 2 - sums.sum(axis=1)
    stats = np.stack([left, top, right - left + 1, bottom - top + 1, area], axis=1).astype(np.int32)
    with np.errstate(invalid="ignore"):
        return Components(count, labels, stats, (sums / area).T)


def component_boxes(mask: Mask) -> NDArray[np.int32]:
    """Left, top, width and height (N, 4) of the components of `mask` (H, W), without the ground, in OpenCV's order."""
    inside = np.ascontiguousarray(mask, np.bool_).view(np.uint8)
    kernels = find_kernels()
    if kernels is None or inside.ndim != 2 or not inside.size:
        return component_boxes_plain(mask)
    boxes = np.empty((USUAL_COMPONENTS, 4), np.int32)
    image = image_of(inside)
    found = kernels.component_boxes(ctypes.byref(image), address(boxes), len(boxes))
    if found > len(boxes):
        boxes = np.empty((found, 4), np.int32)
        found = kernels.component_boxes(ctypes.byref(image), address(boxes), len(boxes))
    if found < 0:
        raise MemoryError
    return boxes[:found]


def component_boxes_plain(mask: Mask) -> NDArray[np.int32]:
    """`component_boxes` by OpenCV: the same."""
    return label_components(mask).stats[1:, :4]


def runs_along_rows(inside: Mask) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Row, first and last column (N,) of the runs of `inside` (H, W) along its rows, in their order."""
    height, width = inside.shape
    # A column of ground before each row keeps runs of two rows apart, and one pixel ends the last run.
    padded = np.zeros(height * (width + 1) + 1, np.bool_)
    padded[:-1].reshape(height, width + 1)[:, 1:] = inside
    changes = np.flatnonzero(padded[1:] != padded[:-1])
    row = changes[::2] // (width + 1)
    before = row * (width + 1)
    return row, changes[::2] - before, changes[1::2] - before - 1
