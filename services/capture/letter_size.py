"""Height of small letters from the rows of text lines: what blur and noise do not change.

Extents of connected components are those of letters only in a good photo: blur joins letters to words, noise and faint
print break them into pieces. Averaged along the text line, print is a band as high as small letters are. The
autocorrelation of that profile falls to a half within a fixed share of the band, whatever the lines' distance is.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree

from services.arrays import Floats, GrayImage, Points, Vector
from services.imaging.node_grid import take_values


@dataclass(frozen=True, slots=True)
class LetterSizeParameters:
    """Lengths are multiples of the height of characters that is known before."""

    windows: int = 24
    """Places on the page that are averaged."""
    across: float = 6.0
    """Half the window's extent across the lines: two lines on either side."""
    along: float = 8.0
    """Half the window's extent along the line: a few words, over which letters average out."""
    rows: int = 97
    columns: int = 24
    half_share: float = 0.47
    """Shift at which the autocorrelation is a half, over the height of small letters; 0.41 to 0.62 for nine tenths of
    223 simulated photos, sharp and spoilt."""
    agreement: float = 2.0
    """If the height differs from the one known before by a larger factor, it is measured again with its own window."""


def text_axes(mesh: Floats, points: Points) -> Floats:
    """Unit vectors (N, 2) along the text lines at photo `points` (N, 2), from the page's `mesh` (rows, columns, 2)."""
    across = np.diff(mesh, axis=1)[:-1]
    middles = (mesh[:-1, :-1] + mesh[1:, 1:]) / 2
    known = np.isfinite(middles).all(axis=-1) & np.isfinite(across).all(axis=-1)
    known &= np.hypot(across[..., 0], across[..., 1]) > 0
    if not known.any():
        return np.tile([1.0, 0.0], (len(points), 1))
    _, nearest = cKDTree(middles[known]).query(points)
    found = across[known][nearest]
    return np.asarray(found / np.hypot(found[:, 0], found[:, 1])[:, None])


def measure_letter_height(gray: GrayImage, at: Points, axes: Floats, height_px: float) -> float:
    """Height (px) of small letters in the photo `gray` (H, W); `height_px` where no lines are seen.

    `at` (N, 2) are places of characters, `axes` (N, 2) the directions of the text lines there, and `height_px` is the
    usual height of the characters that were found.
    """
    p = LetterSizeParameters()
    chosen = np.unique(np.linspace(0, len(at) - 1, min(p.windows, len(at))).astype(int))
    found = _from_rows(gray, at[chosen], axes[chosen], height_px, p)
    if found is not None and not 1 / p.agreement < found / height_px < p.agreement:
        found = _from_rows(gray, at[chosen], axes[chosen], found, p)
    return height_px if found is None else found


def _from_rows(
    gray: GrayImage, at: Points, axes: Floats, height_px: float, p: LetterSizeParameters
) -> float | None:
    v = np.linspace(-p.across, p.across, p.rows) * height_px
    u = np.linspace(-p.along, p.along, p.columns) * height_px
    normal = np.column_stack([-axes[:, 1], axes[:, 0]])
    places = at[:, None, None] + axes[:, None, None] * u[:, None] + normal[:, None, None] * v[:, None, None]
    maps = places.reshape(-1, p.columns, 2).astype(np.float32)
    seen = take_values(gray, maps, cv2.INTER_LINEAR, cv2.BORDER_REPLICATE)
    profiles = seen.reshape(len(at), p.rows, p.columns).mean(axis=2)
    shift = _half_shift(profiles - profiles.mean(axis=1, keepdims=True))
    return None if shift is None else shift * float(v[1] - v[0]) / p.half_share


def _half_shift(profiles: Floats) -> float | None:
    """Shift, in rows, at which the mean autocorrelation of the profiles (N, R) has fallen to a half."""
    rows = profiles.shape[1]
    spectrum = (np.abs(np.fft.rfft(profiles, 2 * rows, axis=1)) ** 2).mean(axis=0)
    overlap: Vector = np.arange(rows, 0, -1.0)
    correlation = np.fft.irfft(spectrum)[:rows] / overlap
    if correlation[0] <= 0:
        return None
    correlation = correlation / correlation[0]
    below = np.flatnonzero(correlation < 0.5)
    if len(below) == 0:
        return None
    last = int(below[0])
    before, after = correlation[last - 1], correlation[last]
    return float(last - 1 + (before - 0.5) / (before - after))
