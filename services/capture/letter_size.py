"""Height of small letters from the rows of text lines: what blur and noise do not change.

Extents of connected components are those of letters only in a good photo: blur joins letters to words, noise and faint
print break them into pieces. Averaged along the text line, print is a band as high as small letters are. The
autocorrelation of that profile falls to a half within a fixed share of the band, whatever the lines' distance is.

The lines of a creased page are not straight on its flat view. So each window is averaged along several directions, and
that of the clearest rows is taken: its angle to the page's axis says how crooked the flat view's lines are.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.fft import rfft, rfftfreq
from scipy.spatial import cKDTree

from services.arrays import Floats, GrayImage, Points, Vector
from services.capture.print_patches import choose_windows
from services.imaging.node_grid import take_values

_ACROSS = 6.0
"""Half the window's extent across the lines: two lines on either side."""
_ALONG = 5.0
"""Half the window's extent along the line: two words, over which letters average out; on creased paper longer lines
are not straight."""
_ROWS = 97
_COLUMNS = 16
_HALF_SHARE = 0.47
"""Shift at which the autocorrelation is a half, over the height of small letters; 0.41 to 0.62 for nine tenths of
223 simulated photos, sharp and spoilt."""
_TILTS_RAD = tuple(np.deg2rad(np.arange(-14.0, 14.1, 2.0)).tolist())
"""Directions of the rows against the page's axis."""
_PLAUSIBLE = (0.25, 4.0)
"""Heights of letters over that of the characters known before, which noise breaks into pieces and blur joins: the
second windows' unit is bounded by these. Crooked lines seem to have higher letters than they have."""


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


@dataclass(frozen=True, slots=True)
class LetterRows:
    """`height_px` of small letters, and the mean angle `tilt_rad` (>= 0) of the rows of text to the page's axis."""

    height_px: float
    tilt_rad: float


def measure_letter_rows(gray: GrayImage, at: Points, axes: Floats, height_px: float) -> LetterRows:
    """Rows of text in the photo `gray` (H, W): `height_px` and no tilt where no lines are seen.

    `at` (N, 2) are places of characters, `axes` (N, 2) the directions of the page's rows there, and `height_px` is the
    usual height of the characters that were found.
    """

    chosen = choose_windows(len(at))
    level = _from_rows(gray, at[chosen], axes[chosen], height_px, (0.0,))
    if level is None:
        return LetterRows(height_px, 0.0)
    # In a window that is too small, a single stroke is the clearest row.
    least, most = _PLAUSIBLE
    window_px = min(max(level.height_px, least * height_px), most * height_px)
    return _from_rows(gray, at[chosen], axes[chosen], window_px, _TILTS_RAD) or level


def _from_rows(
    gray: GrayImage,
    at: Points,
    axes: Floats,
    height_px: float,
    tilts_rad: tuple[float, ...],
) -> LetterRows | None:
    v = np.linspace(-_ACROSS, _ACROSS, _ROWS) * height_px
    u = np.linspace(-_ALONG, _ALONG, _COLUMNS) * height_px
    normal = np.column_stack([-axes[:, 1], axes[:, 0]])
    places = at[:, None, None] + axes[:, None, None] * u[:, None] + normal[:, None, None] * v[:, None, None]
    maps = places.reshape(-1, _COLUMNS, 2).astype(np.float32)
    seen = take_values(gray, maps, cv2.INTER_LINEAR, cv2.BORDER_REPLICATE).reshape(len(at), _ROWS, _COLUMNS)
    spectra = _row_spectra(seen, u / float(v[1] - v[0]), tilts_rad)
    best = np.argmax(spectra.sum(axis=2), axis=1)
    shift = _half_shift(spectra[np.arange(len(at)), best].mean(axis=0), _ROWS)
    if shift is None:
        return None
    tilt = float(np.mean(np.abs(np.array(tilts_rad)[best])))
    return LetterRows(shift * float(v[1] - v[0]) / _HALF_SHARE, tilt)


def _row_spectra(windows: Floats, offsets: Vector, tilts_rad: tuple[float, ...]) -> Floats:
    """Power spectra (N, A, F) of the mean rows of `windows` (N, R, C) along A directions, of twice as many rows.

    `offsets` (C,) of the columns are in rows. A shift of a column is a phase of its spectrum.
    """
    size = 2 * windows.shape[1]
    if tilts_rad == (0.0,):
        windows, offsets = windows.mean(axis=2, keepdims=True), np.zeros(1)
    # Columns are made rows, and numbers single: half of the time.
    columns = np.ascontiguousarray(np.swapaxes(windows, 1, 2), np.float32)
    spectra = rfft(columns - columns.mean(axis=2, keepdims=True), size, axis=2)
    steps = np.tan(np.array(tilts_rad))[:, None] * offsets
    phases = np.exp(2j * np.pi * rfftfreq(size)[:, None, None] * steps) / len(offsets)
    mean_rows = spectra.transpose(2, 0, 1) @ phases.astype(np.complex64).transpose(0, 2, 1)
    return np.asarray(np.abs(mean_rows.transpose(1, 2, 0)) ** 2, np.float64)


def _half_shift(spectrum: Vector, rows: int) -> float | None:
    """Shift, in rows, at which the autocorrelation of a `spectrum` (F,) of twice as many rows has fallen to a half."""
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
