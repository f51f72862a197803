"""Correction of one photo's light, applied at drawing."""

from collections.abc import Sequence
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
        # Rows are taken by one index each: pairs of indices take three times as long.
        c, (above, under) = self.coefficients.reshape(rows * columns, -1), (j * columns, below * columns)
        upper = (1 - s) * c.take(above + i, axis=0) + s * c.take(above + right, axis=0)
        lower = (1 - s) * c.take(under + i, axis=0) + s * c.take(under + right, axis=0)
        return np.asarray((1 - t) * upper + t * lower, np.float32)


def tone_factors(coefficients: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """Factors of `apply_tones`, five of (...), of the coefficients (..., 6) of a `ToneMap`: the gains of both steps are
    one."""
    *gains, gain, slope, offset = np.moveaxis(coefficients, -1, 0)
    return [*(own * gain for own in gains), slope / gain, offset]


def apply_tones(tile: RgbImage, factors: Sequence[NDArray[np.float32]]) -> RgbImage:
    """`tile` (H, W, 3) times the first three of five factors, each (H, W), plus the fourth times the strongest channel
    of that, plus the fifth.

    All steps are OpenCV's, plane by plane: NumPy's on three channels take ten times as long.
    """
    *gains, slope, offset = factors
    balanced = [
        cv2.multiply(channel, own, dtype=cv2.CV_32F)
        for channel, own in zip(cv2.split(tile), gains, strict=True)
    ]
    added = cv2.max(cv2.max(balanced[0], balanced[1]), balanced[2])
    cv2.add(cv2.multiply(added, slope, dst=added), offset, dst=added)
    return np.asarray(cv2.merge([cv2.add(channel, added, dtype=cv2.CV_8U) for channel in balanced]), np.uint8)
