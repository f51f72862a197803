"""Reduced images."""

import ctypes
import threading

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Vector
from services.kernels.library import find_kernels, image_of, is_packed

PRINT_PX = 1200
"""Long side of a copy on which ten-point print of A4 is 8 px high; its strokes are two pixels wide, and rules one."""
GROUND_PX = 400
"""Long side of the copy on which paper and desk are separated: light and paper vary slowly, print is small."""
LARGEST_STEP = 1.3
"""Pixels of an image per drawn pixel up to which interpolation skips none."""
_LEFT_AFTER_HALVES = 0.5
"""Largest factor of the last step. Averages of averages blur twice: with a last step of 0.9 the variance is twice that
of one step, and small letters ran together; from 0.5 down it is at most a third more."""


def halve(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Half of `image` (H, W) or (H, W, 3) by area averages, without an odd last row or column."""
    height, width = image.shape[0] // 2, image.shape[1] // 2
    even = image[: 2 * height, : 2 * width]
    return np.asarray(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


_LARGEST_KEPT_PX = 1 << 20
"""Of a half: 3 MB in colour."""


class Halves:
    """An image, its half, the half of that and so on by area averages; from the quarter on, each is made once.

    Several steps reduce the same photo: a half of 12 megapixels takes 5 ms. It is not kept: its 9 MB would add to the
    peak of the whole work. That of a smaller photo is. Several threads may ask for them.
    """

    def __init__(self, image: NDArray[np.uint8]) -> None:
        """`image` is (H, W) or (H, W, 3)."""
        self.image = image
        self._half: NDArray[np.uint8] | None = None
        self._quarters: list[NDArray[np.uint8]] = []
        self._making = threading.Lock()

    @classmethod
    def of(cls, image: "NDArray[np.uint8] | Halves") -> "Halves":
        """Those of `image`, which may be known already."""
        return image if isinstance(image, Halves) else cls(image)

    def halved(self, times: int) -> NDArray[np.uint8]:
        """The image after `times` halvings, without odd last rows and columns."""
        if times == 0:
            return self.image
        with self._making:
            if times == 1:
                return self._halve()
            if not self._quarters:
                self._quarters.append(halve(self._halve()))
            while len(self._quarters) < times - 1:
                self._quarters.append(halve(self._quarters[-1]))
            return self._quarters[times - 2]

    def _halve(self) -> NDArray[np.uint8]:
        if self._half is not None:
            return self._half
        half = halve(self.image)
        if half.shape[0] * half.shape[1] <= _LARGEST_KEPT_PX:
            self._half = half
        return half


def reduce_image(
    image: NDArray[np.uint8] | Halves,
    factor: float,
    least_side_px: int = 1,
    *,
    fine: bool = True,
) -> NDArray[np.uint8]:
    """`image` (H, W) or (H, W, 3) at `factor` of its size (not above 1) by area averages.

    It is halved while at least another half remains, and then resized to the rest of `factor`. Averages of 2 x 2 pixels
    are several times as fast as those of other areas. Where nothing `fine` such as print is sought, it is halved once
    more. An odd last row or column is left out of a half, and the size is rounded, so a place is off by at most half a
    pixel of the answer at its far ends. No side is below `least_side_px`.
    """
    return reduce_exactly(image, factor, least_side_px, fine=fine)[0]


def reduce_exactly(
    image: NDArray[np.uint8] | Halves, factor: float, least_side_px: int = 1, *, fine: bool = True
) -> tuple[NDArray[np.uint8], Vector]:
    """What `reduce_image` returns, and its factors (2,) across and down, in which the size is not rounded."""
    halves, times = Halves.of(image), 0
    seen = halves.image
    if factor >= 1.0:
        return seen, np.ones(2)
    least, left = min(seen.shape[:2]), _LEFT_AFTER_HALVES if fine else 1.0
    while 2 * factor <= left and least >= 2 * least_side_px:
        times, factor, least = times + 1, 2 * factor, least // 2
    seen = halves.halved(times)
    height, width = (max(round(side * factor), least_side_px) for side in seen.shape[:2])
    factors = np.array([width / seen.shape[1], height / seen.shape[0]]) / 2.0**times
    if (height, width) == seen.shape[:2]:
        return seen, factors
    return average_areas(seen, width, height), factors


def average_areas(image: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """`image` (H, W) or (H, W, C), not smaller, at another size: each pixel is the mean of what it covers."""
    if min(width, height, *image.shape) < 1:
        raise ValueError("images have pixels")
    kernels = find_kernels()
    if kernels is None or not is_packed(image):
        return average_areas_plain(image, width, height)
    reduced = np.empty((height, width, *image.shape[2:]), np.uint8)
    channels = image.shape[2] if image.ndim == 3 else 1
    if not kernels.reduce_area(ctypes.byref(image_of(image)), ctypes.byref(image_of(reduced)), channels):
        raise MemoryError
    return reduced


def average_areas_plain(image: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """`average_areas` by OpenCV: single pixels differ by a gray level."""
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def enlarge_image(image: NDArray[np.uint8], factor: float) -> NDArray[np.uint8]:
    """`image` (H, W) or (H, W, 3) at `factor` of its size (not below 1), cubic between its pixels."""
    height, width = (round(side * factor) for side in image.shape[:2])
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_CUBIC), np.uint8)
