"""Levels of paper and ink over a page: the two modes of its local histograms (dissertation 4.4)."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, Mask, RgbImage
from services.imaging.channels import luminance
from services.imaging.illumination import (
    MEDIAN_FRACTION,
    enlarged,
    odd_size,
    reduced_copy,
    small_backgrounds,
)
from services.imaging.print_counts import PAPER, count_ink, mark_print
from services.imaging.reduction import PRINT_PX

TINTS_OF_LIGHT = (1.25, 1.5)
"""Ratio of paper's strongest to its weakest channel: the largest that white balance may leave, and the least of
coloured paper. Lamps that a phone does not correct leave 1.1 to 1.3; pink and blue forms have 1.3 to 2."""
_NEIGHBOURS = tuple((rows, columns) for rows in range(3) for columns in range(3))


# Localized histogram normalization (dissertation 4.4); levels are shares of white or of paper, 0-1.
FINE_MEDIAN_FRACTION = 1 / 36
"""Median of the background that is divided out: it follows the corners of tinted boxes and shadows."""
TILES = 28
"""Tiles along the long side; a neighbourhood is three by three of them."""
INK_CONTRAST = 0.2
"""Ink is darker than its paper by this share of it, at least."""
INK_SHARES = (0.008, 0.6)
"""Share of a neighbourhood that its ink takes: less is dirt, more is a picture."""
PAPER_SHARE = 0.5
"""Share of a neighbourhood within `paper_spread` of its paper's level; in pictures it is less."""
PAPER_SPREAD = 0.08
PAPER_STEP = 0.15
"""Largest difference between blank paper and the paper next to it; else it is something else."""
DARKEST_PAPER = 0.25
"""Paper in the deepest shadow, against the brightest: what is darker is a desk."""
INK_BINS = 32
"""Ranges of shares in which ink is counted."""
INK_QUANTILE = 0.25
"""Of the ink's histogram: its mode, as far as blurred strokes show it."""
LARGEST_INK = 0.75
"""Ink that is lighter than this is faint print, and stays so."""
LARGEST_CHROMA = 0.25
"""Ink whose channels differ by more than this is coloured; it shows nothing about the level of black."""
BLACK = 0.08
"""Level of ink in the result: deep dark."""


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """The two modes of the histogram round every place of an image, all (h, w) float32 over a reduced copy of it.

    Attributes
    ----------
    paper : luminance of the paper, 1-255.
    ink : level of ink as a share of its paper's, 0-1; 0 everywhere where no ink is known.
    measured : how far (0-1) the paper was measured in this place and not taken from around it.
    """

    paper: NDArray[np.float32]
    ink: NDArray[np.float32]
    measured: NDArray[np.float32]


def level_coefficients(paper: NDArray[np.float32], ink: NDArray[np.float32]) -> NDArray[np.float32]:
    """Affine map (h, w, 3) that shifts `paper` to white and `ink`, (h, w) as in `Levels`, to black.

    Gain of every channel, slope of the strongest channel, offset: all channels take the gain 1 / paper. The strongest
    of them, v, then becomes (v - ink) contrast + black, and the others change by as much: chroma stays, and coloured
    ink, strong in one channel, hardly darkens. Where `ink` is 0 only the gain is left.
    """
    target = np.minimum(BLACK, ink)
    contrast = (1.0 - target) / (1.0 - ink)
    gain = 255.0 / paper
    return np.dstack([gain, gain * (contrast - 1.0), 255.0 * (target - ink * contrast)]).astype(np.float32)


def measure_levels(image: RgbImage) -> Levels | None:
    """Levels of paper and ink over `image` (H, W, 3) RGB uint8; None where nothing looks like print on paper.

    They are measured on a copy of at most `PRINT_PX`, and given on the background's copy.
    """
    small, _ = reduced_copy(image, PRINT_PX)
    gray = luminance(small)
    # Within the wide median of the first background a picture varies, and paper does not.
    background, fine_background = small_backgrounds(gray, None, (MEDIAN_FRACTION, FINE_MEDIAN_FRACTION))
    ground = enlarged(background, *gray.shape)
    height, width = gray.shape
    tiles = min(TILES / max(height, width), 1 / 12)
    grid = (max(1, round(width * tiles)), max(1, round(height * tiles)))
    is_ink, is_paper = mark_print(gray, ground, 1.0 - INK_CONTRAST, PAPER_SPREAD)
    ink_share, _ = _tile_shares(is_ink, grid)
    # Next to a picture the neighbourhood is paper, but the tile itself is not.
    is_even = np.minimum(*_tile_shares(is_paper, grid)) >= PAPER_SHARE
    samples = cv2.resize(background, (3 * grid[0], 3 * grid[1]), interpolation=cv2.INTER_NEAREST)
    level = np.median(np.reshape(samples, (grid[1], 3, grid[0], 3)), axis=(1, 3)).astype(np.float32)
    least, most = INK_SHARES
    printed = is_even & (ink_share >= least) & (ink_share <= most)
    if not np.any(printed):
        return None
    printed &= level >= DARKEST_PAPER * np.quantile(level[printed], 0.9)
    accepted = _grow_paper(level, printed, is_even, PAPER_STEP)
    paper, is_accepted = _level_paper(fine_background, level, accepted, PAPER_STEP)
    rows, columns = printed.shape
    ink = _level_ink(count_ink(small, ground, is_ink, LARGEST_CHROMA, (rows, columns), INK_BINS), printed)
    ink = np.asarray(cv2.resize(ink, paper.shape[::-1], interpolation=cv2.INTER_LINEAR), dtype=np.float32)
    return Levels(paper, ink, is_accepted)


def neutral_gains(paper: NDArray[np.floating]) -> NDArray[np.float32]:
    """Gains (3,) that make paper of this colour (3,) neutral, as far as its tint may come from the light."""
    gains = paper.max() / np.maximum(paper, 1.0)
    least, most = TINTS_OF_LIGHT
    share = np.clip((most - gains.max()) / (most - least), 0, 1)
    return np.asarray(gains**share, np.float32)


def _tile_shares(
    mask: NDArray[np.uint8], grid: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Share of `mask` (h, w) 0/1 round every tile of a grid (columns, rows), and in the tile itself."""
    height, width = mask.shape
    # The integral is exact, and bilinear within a pixel: tiles may begin there.
    sums = cv2.integral(mask, sdepth=cv2.CV_32S)
    x, y = np.linspace(0, width, grid[0] + 1), np.linspace(0, height, grid[1] + 1)
    j, i = np.minimum(x.astype(int), width - 1), np.minimum(y.astype(int), height - 1)
    upper, lower = (rows[:, j] + (x - j) * (rows[:, j + 1] - rows[:, j]) for rows in (sums[i], sums[i + 1]))
    filled = np.diff(np.diff(upper + (y - i)[:, None] * (lower - upper), axis=0), axis=1)
    own = (filled * (grid[0] * grid[1] / (width * height))).astype(np.float32)
    return np.asarray(cv2.blur(own, (3, 3), borderType=cv2.BORDER_REPLICATE), np.float32), own


def _grow_paper(level: NDArray[np.float32], printed: Mask, even: Mask, step: float) -> Mask:
    """Tiles that are paper: those with print, and even ones that differ little from paper next to them."""
    accepted = printed
    padded_level = np.pad(level, 1, mode="edge")
    for _ in range(sum(level.shape)):
        padded = np.pad(accepted, 1)
        beside = np.zeros_like(accepted)
        for rows, columns in _NEIGHBOURS:
            window = (slice(rows, rows + level.shape[0]), slice(columns, columns + level.shape[1]))
            beside |= padded[window] & (np.abs(level - padded_level[window]) <= step * padded_level[window])
        grown = accepted | (even & beside)
        if np.array_equal(grown, accepted):
            break
        accepted = grown
    return accepted


def _level_paper(
    background: GrayImage, level: NDArray[np.float32], accepted: Mask, step: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Level of the paper (h, w), and how far (0-1) it was measured there and not taken from around.

    A pixel's background is its paper's level where it is like an accepted tile's nearby, which keeps both
    the edge of a shadow and that of a picture where they are.
    """
    height, width = background.shape
    rows = np.arange(height) * level.shape[0] // height + 1
    columns = np.arange(width) * level.shape[1] // width + 1
    padded = np.pad(np.where(accepted, level, -1.0), 1, constant_values=-1.0)
    found = background.astype(np.float32)
    is_paper = np.zeros((height, width), dtype=bool)
    for down, right in _NEIGHBOURS:
        near = padded[rows + down - 1].take(columns + right - 1, axis=1)
        is_paper |= np.abs(found - near) <= step * near
    weight = is_paper.astype(np.float32)
    paper = fill_unknown_levels(found, weight, max(height, width) / 32)
    smooth = cv2.GaussianBlur(paper.astype(np.float32), (0, 0), max(height, width) / 200)
    paper = np.where(is_paper, found, smooth).astype(np.float32)
    measured = cv2.GaussianBlur(weight, (0, 0), max(height, width) / 200)
    return np.maximum(paper, 1.0), np.asarray(measured, dtype=np.float32)


def _level_ink(counts: NDArray[np.int64], printed: Mask) -> NDArray[np.float32]:
    """Mode of ink as a share of its paper for every tile, from the printed tiles around it; 0: no ink.

    `counts` (rows, columns, bins) are those of `count_ink`.
    """
    bins = counts.shape[2]
    counts = counts * printed[..., None]
    planes = np.moveaxis(counts, 2, 0).astype(np.float32)
    around = np.stack([cv2.blur(plane, (5, 5), borderType=cv2.BORDER_CONSTANT) for plane in planes])
    below = np.cumsum(around, axis=0)
    reached = np.argmax(below >= INK_QUANTILE * below[-1], axis=0)
    ink = (reached + 0.5) * (256 / bins) / PAPER
    known = ((below[-1] > 0) & (ink <= LARGEST_INK)).astype(np.float32)
    return fill_unknown_levels(ink.astype(np.float32), known, 5.0)


def fill_unknown_levels(
    values: NDArray[np.float32], known: NDArray[np.float32], window: float
) -> NDArray[np.float32]:
    """`values` (h, w) where `known` is 1; elsewhere a mean of known ones, the nearest before all others.

    Means over windows that begin with the given width and double each weigh a hundredth of the one before.
    All is 0 where nothing is known.
    """
    if not np.any(known):
        return np.zeros_like(values)
    side = odd_size(window, 3, 4 * max(values.shape))
    share, value = cv2.split(_spread(np.dstack([known, values * known]), side))
    return np.asarray(np.where(known > 0, values, value / share), dtype=np.float32)


def _spread(planes: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """Means of `planes` (h, w, 2) over windows of `side` and, on copies half as large, over all that are wider."""
    near = np.asarray(cv2.blur(planes, (side, side), borderType=cv2.BORDER_CONSTANT), np.float32)
    height, width = planes.shape[:2]
    if side > 2 * max(height, width):
        return near
    half = cv2.resize(planes, ((width + 1) // 2, (height + 1) // 2), interpolation=cv2.INTER_AREA)
    wider = _spread(np.asarray(half, np.float32), side)
    return near + cv2.resize(wider, (width, height), interpolation=cv2.INTER_LINEAR) / np.float32(100)
