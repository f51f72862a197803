"""Whether there is a sheet within an outline: it is even along the inside of its sides, or the desk along the outside.

Texture has outlines too, but is even on neither side of them.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Points, RgbImage, Vector
from services.geometry.homographies import to_resized
from services.imaging.reduction import GROUND_PX, reduce_image
from services.robust import robust_scale

BESIDE = 0.06
"""The rims are where the outline is drawn towards its middle, or away from it, by this share."""
LEAST_IN_VIEW = 0.3
"""Share of a rim that must be in the photo."""
UNEVEN = 0.6
"""Deviation of the logarithm of brightness along the rim from one that changes linearly over the sheet. With 0.25 two
of six simulated sheets with drawings up to their rim were refused; blotches of colour fail by their hue."""
UNEVEN_HUE = 16.0
"""The same of a and b of CIE Lab."""


def has_even_rim(photo: RgbImage, outline: Points) -> bool:
    """Whether the `photo` (H, W, 3) is even along one side of `outline` (M, 2), but for light and folds."""
    factor = min(1.0, GROUND_PX / max(photo.shape[:2]))
    lab = cv2.cvtColor(reduce_image(photo, factor), cv2.COLOR_RGB2LAB).astype(np.float32)
    away = outline - outline.mean(axis=0)
    return any(_is_even(lab, outline + share * away, factor) for share in (-BESIDE, BESIDE))


def _is_even(lab: NDArray[np.float32], rim: Points, factor: float) -> bool:
    """Whether the colours `lab` (h, w, 3) of the reduced photo are even along `rim` (M, 2), photo pixels."""
    at = to_resized(rim, factor).astype(np.float32)
    inside = ((at >= 0) & (at <= np.array(lab.shape[1::-1]) - 1)).all(axis=1)
    if inside.mean() < LEAST_IN_VIEW:
        return False
    rim, at = rim[inside], at[inside]
    seen = np.asarray(cv2.remap(lab, at[None, :, 0], at[None, :, 1], cv2.INTER_LINEAR)[0], np.float64)
    # Lightness is about the cube root of brightness.
    brightness = 3 * np.log(seen[:, 0] + 8.0)
    hues = [_unevenness(rim, seen[:, channel]) for channel in (1, 2)]
    return _unevenness(rim, brightness) < UNEVEN and max(hues) < UNEVEN_HUE


def _unevenness(at: Points, values: Vector) -> float:
    """Robust deviation of `values` (M,) from a linear function of the places `at` (M, 2)."""
    terms = np.column_stack([np.ones(len(at)), at])
    rest = values - terms @ np.linalg.lstsq(terms, values, rcond=None)[0]
    return robust_scale(rest - np.median(rest))
