"""Drawing of a photo whose JPEG holds colours at half the size: only its luminance is drawn at the full one.

Bicubic interpolation of three channels takes three times as long as of one. What a camera's JPEG (4:2:0) has of colour
differences, half the size holds. Of 12 megapixels such views differ from those of three channels by 64 dB in luminance
and by 60 dB in colour.
"""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, GrayImage, Homography, RgbImage
from services.geometry.homographies import resizing, translation
from services.imaging.channels import luminance
from services.imaging.reduction import halve

Places = tuple[Floats, Floats]

ROWS_BESIDE = 1
"""Rows of colours above and below a band, so that there are no seams between bands."""


class ColorPlanes:
    """`photo` (H, W, 3) as its luminance, and its two colour differences at half the size."""

    def __init__(self, photo: RgbImage) -> None:
        self._luminance = luminance(photo)
        odd_rows, odd_columns = (side % 2 for side in photo.shape[:2])
        even = photo
        if odd_rows or odd_columns:
            even = np.asarray(
                cv2.copyMakeBorder(photo, 0, odd_rows, 0, odd_columns, cv2.BORDER_REPLICATE), np.uint8
            )
        half = cv2.cvtColor(halve(even), cv2.COLOR_RGB2YCrCb)
        self._colors = [np.asarray(color, np.uint8) for color in cv2.split(half)[1:]]

    def draw_plane(self, H_photo_band: Homography, band: RgbImage) -> None:
        """Draw what `H_photo_band` shows into `band` (h, w, 3); white beyond the photo."""
        rows, width = band.shape[:2]
        H_half = resizing(0.5) @ H_photo_band @ resizing(2.0) @ translation(0.0, -float(ROWS_BESIDE))
        size = half_size(width, rows)
        colors = [
            cv2.warpPerspective(
                color,
                H_half,
                size,
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_REPLICATE,
            )
            for color in self._colors
        ]
        gray = cv2.warpPerspective(
            self._luminance,
            H_photo_band,
            (width, rows),
            flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
            borderValue=255.0,
        )
        _join(np.asarray(gray, np.uint8), colors, band)

    def draw_map(self, places: Places, half_places: Places, band: RgbImage) -> None:
        """Draw the photo's `places` x and y (h, w), and its colours at `half_places` (as `half_size`), into `band`."""
        x, y = (axis / np.float32(2) - np.float32(0.25) for axis in half_places)
        colors = [
            cv2.remap(color, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            for color in self._colors
        ]
        gray = cv2.remap(
            self._luminance,
            places[0],
            places[1],
            cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=255.0,
        )
        _join(np.asarray(gray, np.uint8), colors, band)


def half_size(width: int, rows: int) -> tuple[int, int]:
    """Width and height of the colours of a band of `rows`, with those beside it."""
    return -(-width // 2), -(-rows // 2) + 2 * ROWS_BESIDE


def _join(gray: GrayImage, colors: Sequence[NDArray[Any]], band: RgbImage) -> None:
    """Draw `gray` (h, w) with its `colors`, each at half the size, into `band` (h, w, 3)."""
    rows, width = band.shape[:2]
    first = 2 * ROWS_BESIDE
    planes = [gray]
    for color in colors:
        size = (2 * color.shape[1], 2 * color.shape[0])
        large = cv2.resize(color, size, interpolation=cv2.INTER_LINEAR)
        planes.append(np.asarray(large, np.uint8)[first : first + rows, :width])
    # Beyond the photo its last colours go on, but not its light.
    white = cv2.threshold(gray, 254, 255, cv2.THRESH_BINARY)[1]
    view = cv2.cvtColor(cv2.merge(planes), cv2.COLOR_YCrCb2RGB)
    cv2.bitwise_or(view, cv2.merge([white] * 3), dst=band)
