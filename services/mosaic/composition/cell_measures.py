"""What a photo shows in cells of the page: levels, and how steep they are."""

import ctypes
from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import GrayImage
from services.imaging.node_grid import node_count, take_values
from services.kernels.library import CellMaps, KernelPatch, address, find_kernels, image_of, is_packed
from services.mosaic.composition.patch_drawing import FloatMap, PatchNodes, map_between

KERNEL_SIDE_PX = 255
"""Largest cells of the kernel, which adds up levels in 16 bits."""


@dataclass(frozen=True, slots=True, eq=False)
class CellMeasures:
    """Of cells (rows, columns), which may be parts of larger arrays.

    Attributes
    ----------
    gray : mean level.
    covered : share that the photo covers, 255 for all.
    energy : (rows, columns, 2) mean squared gradient per mosaic pixel, across and down (Sobel).
    """

    gray: GrayImage
    covered: GrayImage
    energy: FloatMap

    @classmethod
    def nothing(cls, rows: int, columns: int) -> "CellMeasures":
        """Of a photo that shows nothing."""
        gray, covered = np.zeros((2, rows, columns), np.uint8)
        return cls(gray, covered, np.zeros((rows, columns, 2), np.float32))

    def part(self, at: tuple[slice, slice]) -> "CellMeasures":
        """Those of some rows and columns, a view."""
        return CellMeasures(self.gray[at], self.covered[at], self.energy[at])


def measure_cells(gray_source: GrayImage, nodes: PatchNodes, side: int, into: CellMeasures) -> None:
    """Measure, in place, cells of `side` pixels that `nodes` map, and one pixel more on each side, for the gradient.

    Levels are bilinear between those of `gray_source`: sharpness is compared over whole words, in which all fractions
    of pixels occur. Of cells that are not wholly covered only the share is meant. Outside of the photo its border is
    repeated, to avoid false edges.
    """
    rows, columns = into.gray.shape
    if not into.gray.size or not gray_source.size or side < 1:
        raise ValueError("cells are measured by the pixels of a photo")
    if nodes.source.shape[:2] != node_count(columns * side + 2, rows * side + 2):
        raise ValueError("the nodes are those round the cells, and a pixel more on each side")
    kernels = find_kernels()
    is_usual = min(gray_source.shape) >= 2 and side <= KERNEL_SIDE_PX and is_packed(gray_source)
    if kernels is None or not is_usual:
        measure_cells_plain(gray_source, nodes, side, into)
        return
    values = np.concatenate([nodes.source, nodes.inside], axis=2, dtype=np.float32)
    seen = KernelPatch(nodes=address(values), columns=values.shape[1], values=values.shape[2])
    cells = CellMaps(
        address(into.gray),
        address(into.covered),
        address(into.energy),
        into.gray.strides[0],
        rows,
        columns,
        side,
    )
    if not kernels.measure_cells(
        ctypes.byref(image_of(gray_source)), ctypes.byref(seen), ctypes.byref(cells)
    ):
        raise MemoryError


def measure_cells_plain(gray_source: GrayImage, nodes: PatchNodes, side: int, into: CellMeasures) -> None:
    """`measure_cells` by OpenCV: levels differ by one at most, energies by what that makes."""
    rows, columns = into.gray.shape
    found = map_between(nodes, columns * side + 2, rows * side + 2)
    if found is None:
        return
    drawn = take_values(gray_source, found.source, cv2.INTER_LINEAR, cv2.BORDER_REPLICATE)
    for means, pixels in ((into.gray, drawn), (into.covered, found.covered)):
        inner = np.ascontiguousarray(pixels[1:-1, 1:-1])
        means[:] = cv2.resize(inner, (columns, rows), interpolation=cv2.INTER_AREA)
    for axis, (x, y) in enumerate(((1, 0), (0, 1))):
        slope = cv2.Sobel(drawn, cv2.CV_16S, x, y)[1:-1, 1:-1]
        squared = cv2.multiply(slope, slope, scale=1 / 64, dtype=cv2.CV_32F)
        into.energy[..., axis] = cv2.resize(squared, (columns, rows), interpolation=cv2.INTER_AREA)
