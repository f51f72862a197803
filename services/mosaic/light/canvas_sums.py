"""The mean of photos in matched light on the canvas, and cells in which each photo is compared with it."""

import ctypes
from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import Mask
from services.imaging.channels import in_all_channels, only_where, strongest_channel
from services.kernels.library import CanvasBox, LitView, address, find_kernels
from services.mosaic.light.canvas import CELL_PX, Canvas, CanvasView, FloatImage
from services.mosaic.light.light_field import to_cells

LEAST_WEIGHT = 1e-6
"""Least weight by which a sum is divided: where no photo shows the page the sum is 0."""


@dataclass(frozen=True, slots=True, eq=False)
class CanvasSums:
    """Weighted sums `page` (H, W, 3) and `weight` (H, W) of photos on the canvas, float32."""

    page: FloatImage
    weight: FloatImage

    @classmethod
    def nothing(cls, canvas: Canvas) -> "CanvasSums":
        """Those of no photo."""
        shape = canvas.height, canvas.width
        return cls(np.zeros((*shape, 3), np.float32), np.zeros(shape, np.float32))

    def add(self, view: CanvasView, gain: FloatImage) -> None:
        """Add `view` times its `gain` (h, w, 3), each pixel with the weight of its feather."""
        kernels = find_kernels()
        if kernels is None:
            self.add_plain(view, gain)
            return
        box, seen, held = _passed(self.page, self.weight, self.weight, view, gain)
        done = kernels.add_lit(ctypes.byref(box), ctypes.byref(seen))
        del held
        if not done:
            raise MemoryError

    def add_plain(self, view: CanvasView, gain: FloatImage) -> None:
        """`add` by OpenCV: the same."""
        lit = cv2.multiply(view.image, gain)
        self.page[view.box] += cv2.multiply(lit, in_all_channels(view.feather))
        self.weight[view.box] += view.feather

    def end(self) -> FloatImage:
        """Make the sums means, in place; their strongest channel (H, W)."""
        kernels = find_kernels()
        if kernels is None:
            return self.end_plain()
        strongest = np.empty(self.weight.shape, np.float32)
        kernels.end_mean(
            address(self.page), address(self.weight), self.weight.size, LEAST_WEIGHT, address(strongest)
        )
        return strongest

    def end_plain(self) -> FloatImage:
        """`end` by NumPy: the same."""
        np.divide(
            self.page, in_all_channels(np.maximum(self.weight, np.float32(LEAST_WEIGHT))), out=self.page
        )
        return strongest_channel(self.page)


def compare_cells(
    page: FloatImage, bright: FloatImage, view: CanvasView, gain: FloatImage
) -> tuple[FloatImage, FloatImage]:
    """Mean colours (h, w, 6) of the `page` (H, W, 3) and of `view` times its `gain`, in the cells of the view, and the
    share (h, w) of each that counts.

    What counts is `bright` (H, W), and shown by the view; all else is black.
    """
    kernels = find_kernels()
    if kernels is None:
        return compare_cells_plain(page, bright, view, gain)
    box, seen, held = _passed(page, bright, bright, view, gain)
    rows, columns = (side // CELL_PX for side in view.shown.shape)
    means, share = np.empty((rows, columns, 6), np.float32), np.empty((rows, columns), np.float32)
    kernels.compare_cells(ctypes.byref(box), ctypes.byref(seen), address(means), address(share))
    del held
    return means, share


def compare_cells_plain(
    page: FloatImage, bright: FloatImage, view: CanvasView, gain: FloatImage
) -> tuple[FloatImage, FloatImage]:
    """`compare_cells` by OpenCV: the same."""
    compared = bright[view.box] * view.shown
    mask: Mask = compared > 0
    images = page[view.box], np.asarray(cv2.multiply(view.image, gain), np.float32)
    return np.dstack([to_cells(only_where(mask, image)) for image in images]), to_cells(compared)


def _passed(
    page: FloatImage, weight: FloatImage, bright: FloatImage, view: CanvasView, gain: FloatImage
) -> tuple[CanvasBox, LitView, object]:
    """The view's box of the canvas and the view, as kernels take them, and what must outlive these."""
    height, width = view.shown.shape
    parts = page[view.box], weight[view.box], bright[view.box]
    if parts[0].shape != (height, width, 3) or any(part.shape != (height, width) for part in parts[1:]):
        raise ValueError("a view lies within the canvas")
    if any(part.dtype != np.float32 or part.strides[1] != 4 * part[0, 0].size for part in parts):
        raise ValueError("the canvas has packed rows in single precision")
    held = [np.ascontiguousarray(each, np.float32) for each in (view.image, gain, view.feather)]
    if any(each.shape[:2] != (height, width) for each in held) or held[0].shape != held[1].shape:
        raise ValueError("a view and its gain are of one size")
    shown = np.ascontiguousarray(view.shown, bool)
    box = CanvasBox(*map(address, parts), *(part.strides[0] // 4 for part in parts), width, height)
    return box, LitView(*map(address, (*held, shown))), (held, shown)
