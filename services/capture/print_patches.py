"""Edges and paper round single characters: their blur, the contrast of ink to paper, the paper's noise."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, Points, Vector
from services.order_statistics import high_percentile, percentile_of_sorted

WINDOWS = 48
"""Places on the page round which rows of text and the detail of strokes are measured."""
_HEIGHTS = 0.8
"""Half the side of a patch in text heights: a character and the paper round it."""
_MOST_PX = 40
_SMOOTHING_PX = 0.8
"""Blur before the gradient is taken, so that noise is no edge; it is subtracted from the result."""
_LEVELS = (3.0, 97.0)
"""Percentiles that are ink and paper."""
_LEAST_STEP = 8.0
"""Gray levels between ink and paper; with less there is no edge."""
_STEEPEST_PERCENTILE = 99.0
_DIRECTIONS = 4
"""Of edges, over a half turn: motion blurs one direction and leaves another sharp."""
_EDGE = 0.5
"""Of the steepest gradient of all patches in a direction, what counts as the middle of an edge."""
_DIRECTION_PERCENTILE = 98.0
_LEAST_SHARE = 0.05
"""Of all edge pixels; a direction with fewer shows nothing."""
_STEEPEST_EDGE_PERCENTILE = 90.0
"""Of the gradients at edges of one direction: lower than in a patch, since flat pixels are no part of these."""
_PAPER = 0.8
"""Between ink (0) and paper (1): lighter pixels are paper, on which noise is measured."""


Patches = NDArray[np.float32]
"""(N, S, S) gray values, a character in the middle of each."""


@dataclass(frozen=True, slots=True, eq=False)
class PatchFigures:
    """Of each patch: `blurs` (N,) px by its steepest edge (NaN: no edge), `contrasts` (N,), and figures of all of them.

    `worst_blur_px` is the blur in the direction in which edges are least steep (NaN: no edges). `noise` is the standard
    deviation of the paper's pixels, as a share of the step from ink to paper.
    """

    blurs: Vector
    contrasts: Vector
    worst_blur_px: float
    noise: float
    paper_level: float
    """Gray level of the paper next to the print, 0-255, the median."""


def measure_patches(gray: GrayImage, at: Points, height_px: float) -> PatchFigures:
    """Figures of the patches of `gray` (H, W) round the points `at` (N, 2), on text of the height `height_px`."""

    half = int(np.clip(round(_HEIGHTS * height_px), 3, _MOST_PX))
    margin = 4
    raw = cut_patches(gray, at, half + margin)
    count, side = raw.shape[:2]
    # All patches lie under each other in one image; the margin keeps the blur of one out of the next.
    stacked = cv2.GaussianBlur(raw.reshape(count * side, side), (0, 0), _SMOOTHING_PX)
    inner = slice(margin, side - margin)
    smooth = np.asarray(stacked, np.float32).reshape(count, side, side)[:, inner, inner]
    ordered = np.sort(smooth.reshape(count, -1), axis=1)
    dark, light = (percentile_of_sorted(ordered, level) for level in _LEVELS)
    step = light - dark
    contrasts = step / np.maximum(light, 1.0)
    across = np.diff(smooth, axis=2)[:, :-1]
    down = np.diff(smooth, axis=1)[:, :, :-1]
    slope = np.sqrt(across * across + down * down).reshape(count, -1)
    steepest = high_percentile(slope, _STEEPEST_PERCENTILE)
    seen = (step > _LEAST_STEP) & (steepest > 0)
    blurs = np.full(count, np.nan)
    blurs[seen] = _blur_of(steepest[seen] / step[seen])
    if not seen.any():
        return PatchFigures(blurs, contrasts, float("nan"), 0.0, float(np.median(light)))
    bins = _directions(across[seen].ravel(), down[seen].ravel(), _DIRECTIONS)
    worst = _worst_blur((slope[seen] / step[seen, None]).ravel(), bins)
    rest = (raw[:, inner, inner] - smooth)[seen]
    lightest = (dark + _PAPER * step)[seen, None, None]
    paper = np.abs(rest[smooth[seen] > lightest])
    # The blur takes this share of white noise out of a pixel; the rest is what remains in the difference.
    kept = np.sqrt(1 - 2 * _centre(_SMOOTHING_PX) + 1 / (4 * np.pi * _SMOOTHING_PX**2))
    noise = 1.4826 * float(np.median(paper)) / kept if paper.size else 0.0
    return PatchFigures(
        blurs, contrasts, worst, noise / float(np.median(step[seen])), float(np.median(light))
    )


def choose_windows(count: int, most: int = WINDOWS) -> NDArray[np.intp]:
    """Indices of at most `most` of `count` places, spread evenly."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).astype(np.intp))


def cut_patches(gray: GrayImage, at: Points, half: int) -> Patches:
    """Squares of 2 `half` + 1 pixels of `gray` (H, W) round the points `at` (N, 2); the border is repeated outside."""
    side = 2 * half + 1
    patches = np.empty((len(at), side, side), np.float32)
    first = np.round(at).astype(int) - half
    last = np.array(gray.shape[::-1]) - side
    inside = np.all((first >= 0) & (first <= last), axis=1)
    for patch, (x, y), is_inside in zip(patches, first, inside, strict=True):
        if is_inside:
            patch[...] = gray[y : y + side, x : x + side]
        else:
            rows, columns = (
                np.clip(np.arange(begin, begin + side), 0, size - 1)
                for begin, size in zip((y, x), gray.shape, strict=True)
            )
            patch[...] = gray[rows[:, None], columns]
    return patches


def _centre(sigma_px: float) -> float:
    """Weight of the middle pixel of a Gaussian."""
    taps = np.exp(-0.5 * (np.arange(-6, 7) / sigma_px) ** 2)
    return float((1 / taps.sum()) ** 2)


def _blur_of(steepness: Vector) -> Vector:
    """Standard deviation of the blur (px) of edges of this gradient, as a share of their step a pixel.

    The derivative of a step that a Gaussian blurs is the Gaussian: its peak is step / (sqrt(2 pi) sigma).
    """
    sigma = 1 / (np.sqrt(2 * np.pi) * steepness)
    return np.asarray(np.sqrt(np.maximum(sigma**2 - _SMOOTHING_PX**2, 0.0)))


def _directions(across: Vector, down: Vector, count: int) -> NDArray[np.int8]:
    """Number (E,) of the direction of gradients, of `count` over a half turn; the first one's middle is across."""
    turn = np.where(down < 0, np.float32(-1), np.float32(1))
    across, down = across * turn, down * turn
    number = np.zeros(len(across), np.int8)
    for border in (np.arange(count) + 0.5) * np.pi / count:
        number += down * np.float32(np.cos(border)) >= across * np.float32(np.sin(border))
    return np.asarray(number % np.int8(count), np.int8)


def _worst_blur(slope: Vector, bins: NDArray[np.int8]) -> float:
    """Blur (px) in the direction of the least steep edges, from gradients (E,) with the numbers (E,) of directions."""

    def edges_of(own: Vector) -> Vector:
        return own[own > _EDGE * float(high_percentile(own, _DIRECTION_PERCENTILE))]

    strong = len(edges_of(slope))
    # A direction in which all edges are blurred has no strong gradients, so each has a scale of its own.
    steepest = []
    for number in range(_DIRECTIONS):
        own = slope[bins == number]
        if own.size == 0:
            continue
        edges = edges_of(own)
        if len(edges) > _LEAST_SHARE * strong:
            steepest.append(float(high_percentile(edges, _STEEPEST_EDGE_PERCENTILE)))
    return float(_blur_of(np.array([min(steepest)]))[0]) if steepest else float("nan")
