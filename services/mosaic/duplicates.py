"""Photos that repeat another one of the same upload: the same file, or the same pixels encoded again."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import RgbImage
from services.imaging.channels import luminance
from services.imaging.reduction import reduce_image

_Print = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class DuplicateParameters:
    """Measured on 20 real photos and pages."""

    thumbnail_px: int = 24
    thumbnail_difference: float = 6.0
    """Largest mean difference of thumbnails, gray values; photos that differ more are not compared any further."""
    long_side_px: int = 1000
    """Size at which photos are compared."""
    surroundings_px: int = 15
    """What is compared is the difference from the mean of so many pixels: print, not light."""
    likeness: float = 0.93
    """Least correlation. Encoded again as JPEG of quality 30: 0.95 to 0.999; shifted by two pixels: 0.71 at most."""


def find_duplicates(photos: Sequence[RgbImage], preferred: int | None = None) -> dict[int, int]:
    """For each photo (H, W, 3) that repeats another one, the index of that one.

    Of equal photos the first one stays, or the one with the index `preferred`.
    """
    p = DuplicateParameters()
    order = sorted(range(len(photos)), key=lambda index: (index != preferred, index))
    thumbnails = [
        cv2.resize(luminance(photo), (p.thumbnail_px, p.thumbnail_px), interpolation=cv2.INTER_AREA).astype(
            np.float32
        )
        for photo in photos
    ]
    prints: dict[int, _Print] = {}
    repeats: dict[int, int] = {}

    def print_of(index: int) -> _Print:
        if index not in prints:
            prints[index] = _print_of(photos[index], p)
        return prints[index]

    for place, index in enumerate(order):
        for other in order[:place]:
            if other in repeats or photos[other].shape != photos[index].shape:
                continue
            if float(np.abs(thumbnails[index] - thumbnails[other]).mean()) > p.thumbnail_difference:
                continue
            if float(np.vdot(print_of(index), print_of(other))) >= p.likeness:
                repeats[index] = other
                break
        if index in repeats:
            prints.pop(index, None)
    return repeats


def _print_of(photo: RgbImage, p: DuplicateParameters) -> _Print:
    """What stands out from its surroundings, as a vector of length 1; zeros for a photo that is all of one gray."""
    factor = min(1.0, p.long_side_px / max(photo.shape[:2]))
    gray = reduce_image(luminance(photo), factor).astype(np.float32)
    gray -= cv2.blur(gray, (p.surroundings_px, p.surroundings_px))
    length = float(np.linalg.norm(gray))
    return np.asarray(gray.ravel() / length if length > 0 else gray.ravel() * 0, np.float32)
