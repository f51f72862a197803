"""Windowed projection profiles of ink, for all windows at once (dissertation 2.3.2).

The energy of a profile is its standard deviation. It is largest if the profile's direction is that of the text lines.
There are two scans: a coarse one over the half circle of directions, on a regular grid of windows, and a fine one over
a few degrees around a known direction, at any points.
"""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import saxpy

from services.arrays import Floats, Points, Vector

Energies = Floats


def scan_directions(
    ink: NDArray[np.float32], centres: Points, quarter: Vector, window: tuple[float, float]
) -> Energies:
    """Energies (N, 2 A) of windows at `centres` (N, 2), along the directions `quarter` (A,) and those at right angles.

    `window` is its width along the direction and its height across, px. The image is rotated until a direction is
    horizontal. Box filters along the rows then give the profiles of all windows together, box filters along the columns
    those of the direction a quarter turn further.
    """
    if not len(centres):
        return np.empty((0, 2 * len(quarter)))
    rows, columns = ink.shape
    middle = np.array([(columns - 1) / 2, (rows - 1) / 2])
    width, height = (max(round(v) | 1, 3) for v in window)
    reach = np.arange(-(height // 2), height // 2 + 1)
    # Half a window is added on all sides for the windows that reach beyond the turned image.
    side = int(np.ceil(np.hypot(rows, columns))) + 2 + 2 * (height // 2)
    profiles = np.empty((len(centres), 2, len(quarter), len(reach)), np.float32)
    corners = np.array([[0, 0], [columns - 1, 0], [0, rows - 1], [columns - 1, rows - 1]])
    for k, angle in enumerate(quarter):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, s], [-s, c]])  # photo -> turned frame
        shift = (side - 1) / 2 - turn @ middle
        turned = cv2.warpAffine(ink, np.column_stack([turn, shift]), (side, side), flags=cv2.INTER_LINEAR)
        at = np.round(centres @ turn.T + shift).astype(int)
        # Beyond the ink and the windows, sums are of nothing and for nothing.
        ends = corners @ turn.T + shift
        low = np.minimum(np.floor(ends.min(axis=0)).astype(int) - 2, at.min(axis=0) + reach[0])
        high = np.maximum(np.ceil(ends.max(axis=0)).astype(int) + 3, at.max(axis=0) + reach[-1] + 1)
        low, high = np.maximum(low, 0), np.minimum(high, side)
        turned = turned[low[1] : high[1], low[0] : high[0]]
        x, y = (at - low).T
        for which, (box, step) in enumerate((((width, 1), turned.shape[1]), ((1, width), 1))):
            summed = cv2.blur(turned, box, borderType=cv2.BORDER_CONSTANT | cv2.BORDER_ISOLATED)
            places = (y * turned.shape[1] + x)[:, None] + reach * step
            profiles[:, which, k] = np.asarray(summed).ravel().take(places)
    return np.asarray(profiles.std(axis=-1, dtype=np.float32).reshape(len(centres), -1), np.float64)


def sample_windows(
    image: NDArray[np.float32],
    centres: Points,
    along: Floats,
    across: Floats,
    shape: tuple[int, int],
) -> NDArray[np.float32]:
    """Windows (N, rows, columns) of `image`, bilinear, zero outside.

    Row r and column c of window n lies at centres[n] + (c - (columns-1)/2) along[n] + (r - (rows-1)/2) across[n];
    `along` and `across` (N, 2) are the steps in pixels.
    """
    rows, columns = shape
    u = (np.arange(columns) - (columns - 1) / 2).astype(np.float32)
    v = (np.arange(rows) - (rows - 1) / 2).astype(np.float32)
    at, du, dv = (np.asarray(a, np.float32) for a in (centres, along, across))
    windows = np.empty((len(centres), rows, columns), np.float32)
    per_batch = max(1, 8000 // rows)  # the maps stay in the cache, and below cv2.remap's 32767 rows
    for start in range(0, len(centres), per_batch):
        part = slice(start, start + per_batch)
        rims = at[part, None, :] + v[None, :, None] * dv[part, None, :]  # (n, rows, 2)
        x = (rims[:, :, 0, None] + u * du[part, None, 0, None]).reshape(-1, columns)
        y = (rims[:, :, 1, None] + u * du[part, None, 1, None]).reshape(-1, columns)
        cv2.remap(image, x, y, cv2.INTER_LINEAR, dst=windows[part].reshape(-1, columns))
    return windows


def scan_slopes(
    windows: NDArray[np.float32], slopes: Vector, margin: int, strips: int
) -> tuple[Energies, Floats]:
    """Energies (N, S) of `windows` (N, rows, columns) projected along rows of slope `slopes` (S,).

    A window is first summed to `strips` column sums. A slope then only shifts these relative to each other, by cubic
    interpolation. Linear interpolation blurs at half rows and not at whole ones, which biases the peak to slope 0 (0.15
    degrees, measured). `margin` rows above and below allow for the shifts. Also returns the ink (N,) of the central
    rows.
    """
    count, rows, columns = windows.shape
    if count == 0:  # BLAS takes no empty vectors
        return np.empty((0, len(slopes))), np.zeros(0)
    width = columns // strips
    sums = np.repeat(np.eye(strips, dtype=np.float32), width, axis=0)
    summed = windows[:, :, : width * strips].reshape(-1, width * strips) @ sums
    # Rows first, windows last: what is added up for a slope then lies together in memory.
    used = np.ascontiguousarray(summed.reshape(count, rows, strips).transpose(2, 1, 0))
    for _ in range(2):  # ink is binary; the smoothing makes the peak suitable for a parabola
        used[:, 1:-1] = 0.25 * used[:, :-2] + 0.5 * used[:, 1:-1] + 0.25 * used[:, 2:]
    offset_of = (np.arange(strips) + 0.5) * width - 0.5 - (columns - 1) / 2
    height = rows - 2 * margin
    energies = np.empty((count, len(slopes)))
    for k, slope in enumerate(slopes):
        profile = np.zeros((height, count), np.float32)
        total = profile.ravel()
        for j, offset in enumerate(offset_of * slope):
            whole = int(np.floor(offset))
            top = margin + whole - 1
            for i, weight in enumerate(catmull_rom(offset - whole)):
                saxpy(used[j, top + i : top + i + height].ravel(), total, a=weight)
        energies[:, k] = profile.std(axis=0)
    return energies, used[:, margin : margin + height].sum(axis=(0, 1))


def catmull_rom(t: float) -> NDArray[np.float32]:
    """Weights (4,) of the samples at -1, 0, 1, 2 for the value at 0 <= t < 1."""
    return np.array(
        [
            -0.5 * t + t**2 - 0.5 * t**3,
            1 - 2.5 * t**2 + 1.5 * t**3,
            0.5 * t + 2 * t**2 - 1.5 * t**3,
            -0.5 * t**2 + 0.5 * t**3,
        ],
        np.float32,
    )


def parabola_peak(energies: Energies, positions: Vector) -> tuple[Vector, NDArray[np.bool_]]:
    """Peak position (N,) of sampled curves (N, S) by a parabola through the largest sample and its neighbours.

    The second value is true where the largest sample is an inner one; at the ends the sample's position is returned.
    """
    last = len(positions) - 1
    best = np.argmax(energies, axis=1)
    inner = (best > 0) & (best < last)
    at = np.clip(best, 1, last - 1)
    n = np.arange(len(energies))
    left, middle, right = energies[n, at - 1], energies[n, at], energies[n, at + 1]
    curvature = left - 2 * middle + right
    shift = np.where(curvature < 0, 0.5 * (left - right) / np.where(curvature < 0, curvature, -1.0), 0.0)
    step = positions[1] - positions[0]
    return np.where(inner, positions[at] + np.clip(shift, -1, 1) * step, positions[best]), inner
