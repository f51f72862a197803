"""Photos that repeat another one of the same upload: the same file, or the same pixels encoded again."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import RgbImage
from services.imaging.channels import luminance
from services.imaging.reduction import reduce_image

_Print = NDArray[np.float32]


# Measured on 20 real photos and pages.
THUMBNAIL_PX = 24
THUMBNAIL_DIFFERENCE = 6.0
"""Largest mean difference of thumbnails, gray values; photos that differ more are not compared any further."""
LONG_SIDE_PX = 1000
"""Size at which photos are compared."""
SURROUNDINGS_PX = 15
"""What is compared is the difference from the mean of so many pixels: print, not light."""
LIKENESS = 0.93
"""Least correlation. Encoded again as JPEG of quality 30: 0.95 to 0.999; shifted by two pixels: 0.71 at most."""


def find_duplicates(photos: Sequence[RgbImage], preferred: int | None = None) -> dict[int, int]:
    """For each photo (H, W, 3) that repeats another one, the index of that one.

    Of equal photos the first one stays, or the one with the index `preferred`.
    """
    order = sorted(range(len(photos)), key=lambda index: (index != preferred, index))
    thumbnails = [
        cv2.resize(
            luminance(reduce_image(photo, 1 / 4, fine=False)),
            (THUMBNAIL_PX, THUMBNAIL_PX),
            interpolation=cv2.INTER_AREA,
        ).astype(np.float32)
        for photo in photos
    ]
    prints: dict[int, _Print] = {}
    repeats: dict[int, int] = {}

    def print_of(index: int) -> _Print:
        if index not in prints:
            prints[index] = _print_of(photos[index])
        return prints[index]

    for place, index in enumerate(order):
        for other in order[:place]:
            if other in repeats or photos[other].shape != photos[index].shape:
                continue
            if float(np.abs(thumbnails[index] - thumbnails[other]).mean()) > THUMBNAIL_DIFFERENCE:
                continue
            if float(np.vdot(print_of(index), print_of(other))) >= LIKENESS:
                repeats[index] = other
                break
        if index in repeats:
            prints.pop(index, None)
    return repeats


def _print_of(photo: RgbImage) -> _Print:
    """What stands out from its surroundings, as a vector of length 1; zeros for a photo that is all of one gray."""
    factor = min(1.0, LONG_SIDE_PX / max(photo.shape[:2]))
    gray = reduce_image(luminance(photo), factor).astype(np.float32)
    gray -= cv2.blur(gray, (SURROUNDINGS_PX, SURROUNDINGS_PX))
    length = float(np.linalg.norm(gray))
    return np.asarray(gray.ravel() / length if length > 0 else gray.ravel() * 0, np.float32)
