"""Bicubic drawing of colour images, by a kernel where there is one, else by OpenCV."""

import ctypes
import functools

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Homography, RgbImage
from services.kernels.library import address, find_kernels, image_of, is_packed

STEPS = 1024
"""Places within a pixel that the kernel tells apart."""
ONE = 1 << 15
"""The sum of the kernel's weights of one place."""
SHARPNESS = -0.75
"""Slope of the bicubic kernel at a distance of one pixel: OpenCV's."""
Maps = tuple[NDArray[np.float32], NDArray[np.float32]]


def draw_bicubic(image: RgbImage, view: RgbImage, seen_at: Maps | Homography, beyond: int | None) -> None:
    """Draw `view` (H, W, 3), in place, from `image`.

    Parameters
    ----------
    seen_at
        x and y (H, W) of each pixel of the view in `image`, or the homography of the view to it.
    beyond
        Value of the pixels beyond `image`; None: those of its border are repeated.
    """
    kernels = find_kernels()
    if kernels is None or not is_packed(image) or not is_packed(view):
        draw_bicubic_plain(image, view, seen_at, beyond)
        return
    weights, outside = address(bicubic_weights()), -1 if beyond is None else beyond
    source, target = ctypes.byref(image_of(image)), ctypes.byref(image_of(view))
    if isinstance(seen_at, tuple):
        x, y = seen_at
        if x.strides != y.strides or x.shape != view.shape[:2] or y.shape != x.shape:
            raise ValueError("both maps have the view's size and lie in memory alike")
        row, step = x.strides[0] // x.itemsize, x.strides[1] // x.itemsize
        kernels.draw_bicubic(source, address(x), address(y), row, step, None, weights, outside, target)
    else:
        H_image_view = np.ascontiguousarray(seen_at, np.float64)
        kernels.draw_bicubic(source, None, None, 0, 0, address(H_image_view), weights, outside, target)


def draw_bicubic_plain(
    image: RgbImage, view: RgbImage, seen_at: Maps | Homography, beyond: int | None
) -> None:
    """`draw_bicubic` by OpenCV: no pixel differs by more than one gray level."""
    border = cv2.BORDER_REPLICATE if beyond is None else cv2.BORDER_CONSTANT
    values = (float(beyond or 0),) * 3
    if isinstance(seen_at, tuple):
        cv2.remap(image, *seen_at, cv2.INTER_CUBIC, dst=view, borderMode=border, borderValue=values)
    else:
        size, flags = view.shape[1::-1], cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        cv2.warpPerspective(
            image, seen_at, size, dst=view, flags=flags, borderMode=border, borderValue=values
        )


@functools.cache
def bicubic_weights() -> NDArray[np.int16]:
    """Weights (STEPS, 4) of four neighbours in a row, in units of 1 / ONE, for the places from the second one on.

    Keys, Cubic convolution interpolation for digital image processing (1981), equation 8, with the slope `SHARPNESS`.
    """
    place, a = np.arange(STEPS) / STEPS, SHARPNESS

    def near(distance: Floats) -> Floats:
        return ((a + 2) * distance - (a + 3)) * distance**2 + 1

    def far(distance: Floats) -> Floats:
        return a * (((distance - 5) * distance + 8) * distance - 4)

    weights = np.stack([far(1 + place), near(place), near(1 - place), far(2 - place)], axis=-1)
    whole: NDArray[np.int16] = np.clip(np.rint(weights * ONE), -ONE, ONE - 1).astype(np.int16)
    return whole
