"""How much of the strokes' detail is left in a photo: gradients at the scale of strokes, along and across the lines.

Blur, motion and few pixels all take the fine structure of letters away before the coarse one. So the energy of the
gradients at a fine scale, over the variance at a coarser one, says how far apart strokes still are, whatever the
contrast of the print is. In the direction along a text line lie the vertical strokes, of which letters mostly consist.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import Floats, GrayImage, Points
from services.capture.print_patches import Patches, choose_windows, cut_patches
from services.geometry.homographies import from_resized
from services.order_statistics import percentile

_HALF = 1.2
"""Half the side of a patch: a few letters of one line, and the gaps to its neighbours."""
_FINE = 0.12
"""Standard deviation of the smoothing before gradients are taken: about a stroke's width."""
_COARSE = 0.2
"""That of the image whose variance is the reference."""
_MARGIN = 0.65
"""Round the patch, so that smoothing does not reach the next one."""
_MOST_PX = 20.0
"""Larger letters are reduced to 10 to 20 pixels: strokes have no finer detail."""
_PAPER_PERCENTILE = 60.0
"""Lighter pixels are paper, on which noise is measured."""
_LEAST = 1e-4
"""Smallest ratio; noise hides what is less."""


@dataclass(frozen=True, slots=True)
class StrokeDetail:
    """Energies of gradients (per letter height) over the variance of the coarse image; logarithms of them are features.

    `along` the text lines, `across` them, and `least` in the direction in which there is least.
    """

    along: float
    across: float
    least: float


def measure_strokes(gray: GrayImage, at: Points, axes: Floats, letter_px: float) -> StrokeDetail:
    """Detail of the print of `gray` (H, W) round the points `at` (N, 2).

    `axes` (N, 2) are the directions of the text lines there, `letter_px` is the height of small letters.
    """

    chosen = choose_windows(len(at))
    step = max(1, round(letter_px / (0.75 * _MOST_PX))) if letter_px > _MOST_PX else 1
    size = letter_px / step
    margin = int(np.ceil(_MARGIN * size)) + 2
    half = max(3, round(_HALF * size))
    patches = _cut(gray, at[chosen], half + margin, step)
    inner = slice(margin, -margin)
    noise = _noise(patches[:, inner, inner])
    fine, coarse = _smooth(patches, _FINE * size), _smooth(patches, _COARSE * size)
    dx = (fine[:, 1:-1, 2:] - fine[:, 1:-1, :-2])[:, margin - 1 : 1 - margin, margin - 1 : 1 - margin] / 2
    dy = (fine[:, 2:, 1:-1] - fine[:, :-2, 1:-1])[:, margin - 1 : 1 - margin, margin - 1 : 1 - margin] / 2
    c, s = (axes[chosen, k].astype(np.float32)[:, None, None] for k in (0, 1))
    along, across = c * dx + s * dy, c * dy - s * dx
    unseen = noise**2 * _gradient_gain(_FINE * size)
    xx, yy = float(np.mean(along**2)) - unseen, float(np.mean(across**2)) - unseen
    xy = float(np.mean(along * across))
    least = (xx + yy) / 2 - float(np.hypot((xx - yy) / 2, xy))
    scale = size**2 / max(float(np.mean(coarse[:, inner, inner].var(axis=(1, 2)))), 1e-6)
    return StrokeDetail(*(max(value * scale, _LEAST) for value in (xx, yy, least)))


def _cut(gray: GrayImage, at: Points, half: int, step: int) -> Patches:
    """Patches of 2 `half` + 1 pixels a side, each the mean of `step` x `step` pixels of the photo."""
    if step == 1:
        return cut_patches(gray, at, half)
    # The whole photo is reduced: where letters are large, patches overlap, and together are larger than it.
    columns, rows = max(gray.shape[1] // step, 1), max(gray.shape[0] // step, 1)
    small = cv2.resize(gray[: rows * step, : columns * step], (columns, rows), interpolation=cv2.INTER_AREA)
    return cut_patches(np.asarray(small, np.uint8), from_resized(at, step), half)


def _smooth(patches: Patches, sigma: float) -> Patches:
    count, side = patches.shape[:2]
    smooth = cv2.GaussianBlur(patches.reshape(count * side, side), (0, 0), max(sigma, 0.1))
    return np.asarray(smooth, np.float32).reshape(patches.shape)


def _noise(patches: Patches) -> float:
    """Standard deviation of white noise on the paper, by the mask of Immerkaer (1996), which cancels edges."""
    second = patches[:, :, 2:] - 2 * patches[:, :, 1:-1] + patches[:, :, :-2]
    mixed = np.abs(second[:, 2:] - 2 * second[:, 1:-1] + second[:, :-2])
    middle = patches[:, 1:-1, 1:-1]
    light = percentile(middle.reshape(len(middle), -1), _PAPER_PERCENTILE)[:, None, None]
    on_paper = mixed[middle > light]
    return float(np.median(on_paper)) / 0.6745 / 6 if on_paper.size else 0.0


def _gradient_gain(sigma: float) -> float:
    """Variance of central differences of white noise that was smoothed by a Gaussian."""
    point = np.zeros((41, 41), np.float32)
    point[20, 20] = 1
    seen = cv2.GaussianBlur(point, (0, 0), max(sigma, 0.1))
    return float(np.sum(((seen[:, 2:] - seen[:, :-2]) / 2) ** 2))
