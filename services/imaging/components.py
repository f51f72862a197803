"""Connected components of a mask."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Mask, Points


class Components(NamedTuple):
    """Components of a mask (H, W), joined along sides and corners; number 0 is the ground.

    There are `total` with the ground. `labels` (H, W) is the number of the component of each pixel. Of each number,
    `stats` (N, 5) has left, top, width, height and area, as OpenCV's `CC_STAT_...`, and `centres` (N, 2) the mean
    (x, y) of its pixels.
    """

    total: int
    labels: NDArray[np.int32]
    stats: NDArray[np.int32]
    centres: Points


def label_components(mask: Mask | NDArray[np.uint8]) -> Components:
    """Components of `mask` (H, W), non-zero inside.

    OpenCV numbers components alike in its default algorithm and in the one by blocks of 2 x 2 pixels, which takes half
    the time when areas and boxes are measured too (6 instead of 13 ms for 2 megapixels).
    """
    pixels = np.asarray(mask.view(np.uint8) if mask.dtype == np.bool_ else mask, np.uint8)
    count, labels, stats, centres = cv2.connectedComponentsWithStatsWithAlgorithm(
        pixels, 8, cv2.CV_32S, cv2.CCL_BBDT
    )
    return Components(
        count, np.asarray(labels, np.int32), np.asarray(stats, np.int32), np.asarray(centres, np.float64)
    )
