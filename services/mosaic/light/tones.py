"""Correction of one photo's light, applied at drawing."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Points, RgbImage


@dataclass(frozen=True, slots=True, eq=False)
class ToneMap:
    """Change of a photo's colours, smooth over its flat view.

    `coefficients` (rows, columns, 6) float32 are sampled at the centres of equal cells of the view, which has `width` x
    `height` flat pixels. Three are gains of red, green and blue (white balance and light, matched between photos). The
    other three are the levels of localized histogram normalization (4.4), applied after the gains: gain of every
    channel, slope of the strongest channel, offset.
    """

    coefficients: NDArray[np.float32]
    width: int
    height: int

    def at(self, flat: Points) -> NDArray[np.float32]:
        """Coefficients (N, 6) at flat pixels (N, 2), bilinear; constant beyond the border."""
        rows, columns = self.coefficients.shape[:2]
        x = ((flat[:, 0] + 0.5) * columns / self.width - 0.5).astype(np.float32)
        y = ((flat[:, 1] + 0.5) * rows / self.height - 0.5).astype(np.float32)
        i = np.clip(np.floor(x).astype(int), 0, max(columns - 2, 0))
        j = np.clip(np.floor(y).astype(int), 0, max(rows - 2, 0))
        s, t = np.clip(x - i, 0, 1)[:, None], np.clip(y - j, 0, 1)[:, None]
        right, below = np.minimum(i + 1, columns - 1), np.minimum(j + 1, rows - 1)
        c = self.coefficients
        upper = (1 - s) * c[j, i] + s * c[j, right]
        lower = (1 - s) * c[below, i] + s * c[below, right]
        return np.asarray((1 - t) * upper + t * lower, np.float32)


def apply_tones(tile: RgbImage, coefficients: NDArray[np.float32]) -> RgbImage:
    """`tile` (H, W, 3), changed by `coefficients` (H, W, 6) of a `ToneMap` at its pixels."""
    balanced = cv2.multiply(tile.astype(np.float32), np.ascontiguousarray(coefficients[..., :3]))
    gain, slope, offset = cv2.split(np.ascontiguousarray(coefficients[..., 3:]))
    red, green, blue = cv2.split(balanced)
    added = cv2.max(cv2.max(red, green), blue) * slope + offset
    toned = cv2.merge([channel * gain + added for channel in (red, green, blue)])
    return np.asarray(np.clip(toned + 0.5, 0, 255), np.uint8)
