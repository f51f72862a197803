"""How often colours occur in parts of a photo."""

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask

_COLOR_BINS = (18, 32, 32)
_NEIGHBOURS = np.stack(np.meshgrid(*3 * [[-1, 0, 1]], indexing="ij"), axis=-1).reshape(-1, 3)
_SMOOTHED = 0.5 ** np.abs(_NEIGHBOURS).sum(axis=1)
"""Weights of neighbouring bins, as `color_density` smooths them."""


def color_codes(colors: Floats) -> NDArray[np.int64]:
    """Index of the colour bin of every pixel."""
    bins = (colors / np.array([6.0, 6.0, 6.0], np.float32) + np.array([0, 16, 16], np.float32)).astype(
        np.int64
    )
    bins = np.clip(bins, 0, np.array(_COLOR_BINS) - 1)
    return np.asarray((bins[..., 0] * _COLOR_BINS[1] + bins[..., 1]) * _COLOR_BINS[2] + bins[..., 2])


def color_density(codes: NDArray[np.int64]) -> Floats:
    """Share of `codes` in every colour bin, smoothed over neighbours."""
    cube = count_colors(codes).reshape(_COLOR_BINS).astype(np.float32)
    for axis in range(3):
        cube = cube + 0.5 * (np.roll(cube, 1, axis) + np.roll(cube, -1, axis))
    return np.asarray(cube.ravel() / max(float(cube.sum()), 1.0))


def color_log_odds(codes: NDArray[np.int64], inside: Mask, outside: Mask | None) -> Floats:
    """(h, w) log ratio of how often a pixel's colour occurs `inside` and `outside` (None: anywhere), limited to -1..1.

    `codes` (h, w) are its pixels' colour bins.
    """
    floor = 1e-5
    within = color_density(codes[inside]) + floor
    beyond = color_density(codes if outside is None else codes[outside]) + floor
    return np.asarray(np.clip(np.log(within / beyond), -1, 1)[codes])


def color_log_odds_of(
    sought: NDArray[np.int64], inside: NDArray[np.intp], outside: NDArray[np.intp]
) -> Floats:
    """The same of the colour bins `sought` (N,) alone, by the numbers of pixels in every bin `inside` and `outside`."""
    floor = 1e-5
    axes = np.stack(np.unravel_index(sought, _COLOR_BINS), axis=1)
    around = (axes[:, None] + _NEIGHBOURS) % np.array(_COLOR_BINS)
    bins = np.ravel_multi_index(tuple(np.moveaxis(around, 2, 0)), _COLOR_BINS)
    within, beyond = (
        counts[bins] @ _SMOOTHED / max(8.0 * float(counts.sum()), 1.0) + floor for counts in (inside, outside)
    )
    return np.asarray(np.clip(np.log(within / beyond), -1, 1))


def count_colors(codes: NDArray[np.int64]) -> NDArray[np.intp]:
    """Number of `codes` in every colour bin."""
    return np.bincount(codes.ravel(), minlength=int(np.prod(_COLOR_BINS)))
