"""Connected components of a mask."""

import ctypes
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, Vector
from services.kernels.library import address, find_kernels, image_of


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
    """Components of `mask` (H, W), non-zero inside, in the order of their first blocks of 2 x 2 pixels."""
    inside = np.ascontiguousarray(mask if mask.dtype == np.bool_ else mask != 0, np.bool_)
    kernels = find_kernels()
    if kernels is None or not inside.size:
        return label_components_plain(inside)
    height, width = inside.shape
    image, labels = ctypes.byref(image_of(inside.view(np.uint8))), np.zeros((height, width), np.int32)
    total = kernels.label_mask(image, address(labels))
    bounds = np.tile(np.array([width, -1, height, 0, 0], np.int32), (total, 1))
    sums = np.zeros((2, total))
    if not total or not kernels.measure_labels(image, address(labels), total, address(bounds), address(sums)):
        raise MemoryError
    return _described(labels, bounds, sums)


def label_components_plain(inside: Mask) -> Components:
    """`label_components` without a kernel.

    OpenCV numbers them, by blocks of 2 x 2 pixels. They are measured by their runs along rows: OpenCV adds up all
    pixels of the mask one by one, which takes three times as long as all else.
    """
    count, found = cv2.connectedComponentsWithAlgorithm(
        np.ascontiguousarray(inside).view(np.uint8), 8, cv2.CV_32S, cv2.CCL_BBDT
    )
    labels = np.asarray(found, np.int32)
    y, first, last = runs_along_rows(inside)
    own = labels[y, first]
    length = last - first + 1
    left, right = np.full(count, inside.shape[1]), np.full(count, -1)
    np.minimum.at(left, own, first)
    np.maximum.at(right, own, last)
    # Runs are in the order of their rows: of one component's, the first and the last are assigned last.
    top, bottom = np.zeros(count, np.intp), np.zeros(count, np.intp)
    top[own[::-1]], bottom[own] = y[::-1], y
    sums = np.stack(
        [
            np.asarray(np.bincount(own, weights, count), np.float64)
            for weights in (length * (first + last) / 2, length * y)
        ]
    )
    area = np.bincount(own, length, count)
    return _described(labels, np.stack([left, right, top, bottom, area], axis=1).astype(np.int32), sums)


def _described(labels: NDArray[np.int32], bounds: NDArray[np.int32], sums: Floats) -> Components:
    """Components by their first and last columns and rows, and areas, `bounds` (N, 5), and `sums` (2, N) of x and y.

    What is given of the ground is overwritten.
    """
    height, width = labels.shape
    bounds[0] = 0, width - 1, 0, height - 1, labels.size - bounds[1:, 4].sum()
    sums[:, 0] = np.array([width - 1, height - 1]) * labels.size / 2 - sums[:, 1:].sum(axis=1)
    left, right, top, bottom, area = bounds.T
    stats = np.stack([left, top, right - left + 1, bottom - top + 1, area], axis=1)
    with np.errstate(invalid="ignore"):
        return Components(len(bounds), labels, stats, (sums / area).T)


def keep_components(mask: Mask, labels: NDArray[np.int32], chosen: NDArray[np.bool_]) -> Mask:
    """Those pixels of `mask` (H, W) whose component, by `labels` (H, W), is `chosen` (N,)."""
    kernels = find_kernels()
    if mask.shape != labels.shape:
        raise ValueError("each pixel has a label")
    if kernels is None or not labels.flags.c_contiguous:
        return keep_components_plain(mask, labels, chosen)
    mask, found = np.ascontiguousarray(mask), np.zeros(mask.shape, bool)
    image = ctypes.byref(image_of(mask.view(np.uint8)))
    chosen = np.ascontiguousarray(chosen)
    kernels.keep_labels(image, address(labels), address(chosen), len(chosen), address(found))
    return found


def keep_components_plain(mask: Mask, labels: NDArray[np.int32], chosen: NDArray[np.bool_]) -> Mask:
    """`keep_components` without a kernel."""
    # Little of a page is ink: looking up its pixels alone takes a third of the time.
    at = np.flatnonzero(mask)
    found = np.zeros(mask.size, bool)
    found[at] = chosen[labels.ravel()[at]]
    return found.reshape(mask.shape)


def sum_distances(mask: Mask, labels: NDArray[np.int32], count: int) -> Vector:
    """Sums (count,) over the pixels of each component of `mask` (H, W) of their distances from the ground, px.

    Distances are those of steps to neighbours. The kernel's differ from OpenCV's by rounding.
    """
    kernels = find_kernels()
    if mask.shape != labels.shape:
        raise ValueError("each pixel has a label")
    if kernels is None or not labels.flags.c_contiguous:
        return sum_distances_plain(mask, labels, count)
    mask, total = np.ascontiguousarray(mask), np.zeros(count)
    if not kernels.sum_distances(
        ctypes.byref(image_of(mask.view(np.uint8))), address(labels), address(total), count
    ):
        raise MemoryError
    return total


def sum_distances_plain(mask: Mask, labels: NDArray[np.int32], count: int) -> Vector:
    """`sum_distances` without a kernel."""
    distance = np.asarray(cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, 3))
    at = np.flatnonzero(mask)
    return np.asarray(
        np.bincount(labels.ravel()[at], weights=distance.ravel()[at], minlength=count), np.float64
    )


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
