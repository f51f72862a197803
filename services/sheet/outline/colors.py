"""How often colours occur in parts of a photo."""

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask
from services.kernels.library import address, find_kernels

_COLOR_BINS = (18, 32, 32)
_BINS = int(np.prod(_COLOR_BINS))
_FLOOR = 1e-5
"""Of a density: log odds of colours that do not occur are finite."""

Codes = NDArray[np.uint16]
"""Numbers of colour bins."""
Counts = NDArray[np.int64]
"""Numbers of pixels in all colour bins (K,)."""


def color_codes(colors: Floats) -> Codes:
    """Index (...) of the bin of every one of the `colors` (..., 3), CIE Lab."""
    kernels = find_kernels()
    if kernels is None:
        return color_codes_plain(colors)
    colors = np.ascontiguousarray(colors, np.float32)
    codes = np.empty(colors.shape[:-1], np.uint16)
    kernels.color_codes(address(colors), codes.size, address(codes))
    return codes


def color_codes_plain(colors: Floats) -> Codes:
    """`color_codes` without a kernel."""
    bins = (colors / np.array([6.0, 6.0, 6.0], np.float32) + np.array([0, 16, 16], np.float32)).astype(
        np.int64
    )
    bins = np.clip(bins, 0, np.array(_COLOR_BINS) - 1)
    return np.asarray(
        (bins[..., 0] * _COLOR_BINS[1] + bins[..., 1]) * _COLOR_BINS[2] + bins[..., 2], np.uint16
    )


def count_colors(codes: Codes, inside: Mask | None = None) -> Counts:
    """Number of `codes` (...) in every colour bin; of those `inside` (...) alone if that is given."""
    kernels = find_kernels()
    if kernels is None or inside is None:
        return count_colors_plain(codes, inside)
    if inside.shape != codes.shape:
        raise ValueError("a mask is as large as what it chooses from")
    codes, inside = np.ascontiguousarray(codes, np.uint16), np.ascontiguousarray(inside, bool)
    counts = np.empty(_BINS, np.int64)
    kernels.count_colors(address(codes), address(inside), codes.size, address(counts))
    return counts


def count_colors_plain(codes: Codes, inside: Mask | None = None) -> Counts:
    """`count_colors` without a kernel."""
    chosen = codes if inside is None else codes[inside]
    return np.bincount(chosen.ravel(), minlength=_BINS)


def smooth_colors(counts: Counts) -> NDArray[np.float32]:
    """`counts` with half of those of neighbouring bins along each axis: eight times as many; exact below 2^21."""
    kernels = find_kernels()
    if kernels is None:
        return smooth_colors_plain(counts)
    counts = np.ascontiguousarray(counts, np.int64)
    if counts.shape != (_BINS,):
        raise ValueError("colours are counted in all bins")
    smooth = np.empty(_BINS, np.float32)
    if not kernels.smooth_colors(address(counts), address(smooth)):
        raise MemoryError
    return smooth


def smooth_colors_plain(counts: Counts) -> NDArray[np.float32]:
    """`smooth_colors` without a kernel."""
    cube = counts.reshape(_COLOR_BINS).astype(np.float32)
    for axis in range(3):
        cube = cube + np.float32(0.5) * (np.roll(cube, 1, axis) + np.roll(cube, -1, axis))
    return np.asarray(cube.ravel(), np.float32)


def color_density(counts: Counts) -> NDArray[np.float32]:
    """Share of the `counts` in every colour bin, smoothed over neighbours."""
    return np.asarray(smooth_colors(counts) / np.float32(max(8.0 * float(counts.sum()), 1.0)), np.float32)


def color_log_odds(inside: Counts, outside: Counts, sought: Codes | None = None) -> NDArray[np.float32]:
    """Log ratio of how often the colour bins `sought` (...) occur `inside` and `outside`, limited to -1..1.

    Of all bins (K,) where none are given.
    """
    bins = slice(None) if sought is None else sought
    within, beyond = (color_density(counts)[bins] + np.float32(_FLOOR) for counts in (inside, outside))
    return np.clip(np.log(within / beyond), np.float32(-1), np.float32(1))
