"""Bicubic drawing of colour images, by a kernel where there is one, else by OpenCV."""

import ctypes
import functools

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Homography, RgbImage
from services.imaging.node_grid import maps_between, node_count
from services.kernels.library import Map, address, find_kernels, image_of, is_packed

STEPS = 1024
"""Places within a pixel that the kernel tells apart."""
ONE = 1 << 15
"""The sum of the kernel's weights of one place."""
SHARPNESS = -0.75
"""Slope of the bicubic kernel at a distance of one pixel: OpenCV's."""


def draw_by_map(
    image: RgbImage, view: RgbImage, x: NDArray[np.float32], y: NDArray[np.float32], beyond: int | None
) -> None:
    """Draw `view` (H, W, 3), in place, whose pixels are seen at `x` and `y` (H, W) of `image`.

    Pixels beyond `image` have the value `beyond`; None: those of its border are repeated.
    """
    if x.strides != y.strides or x.shape != view.shape[:2] or y.shape != x.shape:
        raise ValueError("both maps have the view's size and lie in memory alike")
    if x.dtype != np.float32 or y.dtype != np.float32:
        raise ValueError("maps have single precision")
    row, step = x.strides[0] // x.itemsize, x.strides[1] // x.itemsize
    if not _draw("draw_by_map", image, view, beyond, Map(address(x), address(y), row, step)):
        draw_by_map_plain(image, view, x, y, beyond)


def draw_by_map_plain(
    image: RgbImage, view: RgbImage, x: NDArray[np.float32], y: NDArray[np.float32], beyond: int | None
) -> None:
    """`draw_by_map` by OpenCV: no pixel differs by more than one gray level; nor with the next two functions."""
    border, values = _border(beyond)
    cv2.remap(image, x, y, cv2.INTER_CUBIC, dst=view, borderMode=border, borderValue=values)


def draw_between_nodes(
    image: RgbImage, view: RgbImage, nodes: NDArray[np.float32], beyond: int | None
) -> None:
    """The same by the `nodes` (rows, columns, 2), x and y, of the view's `node_grid`; NaN where nothing is seen."""
    if nodes.shape != (*node_count(view.shape[1], view.shape[0]), 2):
        raise ValueError("the nodes are those round the view")
    packed = np.ascontiguousarray(nodes, np.float32)
    first = address(packed)
    where = Map(first, first + packed.itemsize, 2 * packed.shape[1], 2)
    if not _draw("draw_between_nodes", image, view, beyond, where):
        draw_between_nodes_plain(image, view, nodes, beyond)


def draw_between_nodes_plain(
    image: RgbImage, view: RgbImage, nodes: NDArray[np.float32], beyond: int | None
) -> None:
    """`draw_between_nodes` by OpenCV."""
    draw_by_map_plain(image, view, *maps_between(nodes, view.shape[1], view.shape[0]), beyond)


def draw_by_homography(image: RgbImage, view: RgbImage, H_image_view: Homography, beyond: int | None) -> None:
    """The same by the homography (3, 3) of the view to `image`."""
    H = np.ascontiguousarray(H_image_view, np.float64)
    if not _draw("draw_by_homography", image, view, beyond, Map(H=address(H))):
        draw_by_homography_plain(image, view, H_image_view, beyond)


def draw_by_homography_plain(
    image: RgbImage, view: RgbImage, H_image_view: Homography, beyond: int | None
) -> None:
    """`draw_by_homography` by OpenCV."""
    border, values = _border(beyond)
    size, flags = view.shape[1::-1], cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    cv2.warpPerspective(
        image, H_image_view, size, dst=view, flags=flags, borderMode=border, borderValue=values
    )


def _draw(kernel: str, image: RgbImage, view: RgbImage, beyond: int | None, where: Map) -> bool:
    """Whether there is a kernel that has drawn `view`."""
    if not image.size or image.shape[2:] != (3,) or view.shape[2:] != (3,) or not view.flags.writeable:
        raise ValueError("views are drawn from pixels of three bytes, into what may be written")
    kernels = find_kernels()
    if kernels is None or not is_packed(image) or not is_packed(view):
        return False
    source, target = ctypes.byref(image_of(image)), ctypes.byref(image_of(view))
    outside = -1 if beyond is None else beyond
    getattr(kernels, kernel)(source, target, address(bicubic_weights()), outside, ctypes.byref(where))
    return True


def _border(beyond: int | None) -> tuple[int, tuple[float, float, float]]:
    """OpenCV's mode and values."""
    value = float(beyond or 0)
    return cv2.BORDER_REPLICATE if beyond is None else cv2.BORDER_CONSTANT, (value, value, value)


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
