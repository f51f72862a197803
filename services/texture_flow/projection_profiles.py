"""Windowed projection profiles of ink, for all windows at once (dissertation 2.3.2).

The energy of a profile is its standard deviation. It is largest if the profile's direction is that of the text lines.
There are two scans: a coarse one over the half circle of directions, on a regular grid of windows, and a fine one over
a few degrees around a known direction, at any points.
"""

import ctypes
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import saxpy

from services.arrays import Floats, Mask, Points, Vector
from services.kernels.library import TextWindows, TurnedImage, address, find_kernels, image_of

Energies = Floats
_LEAST_INK = np.float32(1e-6)
"""A window without ink has its centroid in the middle."""


class WindowShape(NamedTuple):
    """Rows and columns of windows, rows in reserve above and below for slopes, and strips of columns."""

    rows: int
    columns: int
    margin: int
    strips: int


class WindowFigures(NamedTuple):
    """Of N windows: `energies` (N, S) along the slopes, and the `amount` (N,) of smoothed ink in the central rows.

    `aside` (N,) is how far the centroid of that ink lies from the middle, in columns.
    """

    energies: Energies
    amount: NDArray[np.float32]
    aside: NDArray[np.float32]


def scan_directions(
    ink: NDArray[np.float32], centres: Points, quarter: Vector, window: tuple[float, float]
) -> Energies:
    """Energies (N, 2 A) of windows at `centres` (N, 2), along the directions `quarter` (A,) and those at right angles.

    `window` is its width along the direction and its height across, px. The image is rotated until a direction is
    horizontal. Sums along the rows are then its profiles, sums along the columns those of the direction a quarter turn
    further.
    """
    if not len(centres):
        return np.empty((0, 2 * len(quarter)))
    rows, columns = ink.shape
    middle = np.array([(columns - 1) / 2, (rows - 1) / 2])
    width, height = (max(round(v) | 1, 3) for v in window)
    reach = height // 2
    # Half a window is added on all sides for the windows that reach beyond the turned image.
    side = int(np.ceil(np.hypot(rows, columns))) + 2 + 2 * reach
    energies = np.empty((len(centres), 2, len(quarter)))
    corners = np.array([[0, 0], [columns - 1, 0], [0, rows - 1], [columns - 1, rows - 1]])
    for k, angle in enumerate(quarter):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, s], [-s, c]])  # photo -> turned frame
        shift = (side - 1) / 2 - turn @ middle
        turned = cv2.warpAffine(ink, np.column_stack([turn, shift]), (side, side), flags=cv2.INTER_LINEAR)
        at = np.round(centres @ turn.T + shift).astype(int)
        # Beyond the ink and the windows, sums are of nothing and for nothing.
        ends = corners @ turn.T + shift
        low = np.minimum(np.floor(ends.min(axis=0)).astype(int) - 2, at.min(axis=0) - reach)
        high = np.maximum(np.ceil(ends.max(axis=0)).astype(int) + 3, at.max(axis=0) + reach + 1)
        low, high = np.maximum(low, 0), np.minimum(high, side)
        part = np.asarray(turned[low[1] : high[1], low[0] : high[0]], np.float32)
        measure_turned(part, at - low, reach, width, energies[:, :, k])
    return energies.reshape(len(centres), -1)


def measure_turned(
    turned: NDArray[np.float32], places: NDArray[np.int_], reach: int, width: int, energies: Floats
) -> None:
    """Energies (N, 2) of the windows with the middles `places` (N, 2), in pixels (x, y) of the `turned` ink (H, W).

    First of the profile of rows, `reach` up and down from the middle, whose ink is added up over an odd `width`; then
    of that of columns. Profiles lie in the image; what is added up may lie beyond it, where there is nothing.
    """
    kernels = find_kernels()
    if kernels is None or turned.strides[1] != turned.itemsize:
        return measure_turned_plain(turned, places, reach, width, energies)
    if (places - reach < 0).any() or (places + reach >= turned.shape[::-1]).any() or width % 2 == 0:
        raise ValueError("profiles lie in the image, and windows have a middle")
    if energies.shape != (len(places), 2):
        raise ValueError("each window has two energies")
    height, columns = turned.shape
    image = TurnedImage(
        address(turned), turned.strides[0] // turned.itemsize, columns, height, reach, width // 2
    )
    steps = (step // energies.itemsize for step in energies.strides)
    at = np.ascontiguousarray(places, np.int32)
    if not kernels.measure_turned(ctypes.byref(image), address(at), len(at), address(energies), *steps):
        raise MemoryError
    return None


def measure_turned_plain(
    turned: NDArray[np.float32], places: NDArray[np.int_], reach: int, width: int, energies: Floats
) -> None:
    """`measure_turned` without a kernel: box filters give the profiles of all windows together."""
    x, y = places.T
    offsets = np.arange(-reach, reach + 1)
    for which, (box, step) in enumerate((((width, 1), turned.shape[1]), ((1, width), 1))):
        summed = cv2.blur(turned, box, borderType=cv2.BORDER_CONSTANT | cv2.BORDER_ISOLATED)
        at = (y * turned.shape[1] + x)[:, None] + offsets * step
        energies[:, which] = np.asarray(summed).ravel().take(at).std(axis=-1, dtype=np.float32)


def measure_windows(
    ink: Mask, centres: Points, along: Floats, across: Floats, slopes: Vector, shape: WindowShape
) -> WindowFigures:
    """Windows of `ink` (H, W), as of `sample_windows`, projected along rows of `slopes` (S,), as of `scan_slopes`.

    The kernel adds in the order of NumPy, BLAS and OpenCV, so that the numbers are theirs to the last bit. NumPy adds
    along a single window in another order.
    """
    kernels = find_kernels()
    if kernels is None or len(centres) == 1:
        return measure_windows_plain(ink, centres, along, across, slopes, shape)
    offsets = slopes[:, None] * _middles_of_strips(shape.columns, shape.strips)
    whole = np.floor(offsets)
    if min(centres.shape[0], along.shape[0], across.shape[0]) < len(centres) or shape.columns < shape.strips:
        raise ValueError("each window has a place and steps, and each strip a column")
    if np.abs(whole).max(initial=0) + 2 > shape.margin or shape.rows <= 2 * shape.margin:
        raise ValueError("shifts are within the margin")
    shifts = whole.astype(np.int32)
    weights = np.ascontiguousarray(np.moveaxis(catmull_rom(offsets - whole), 0, -1))
    at, du, dv = (np.ascontiguousarray(a, np.float32) for a in (centres, along, across))
    count = len(at)
    energies = np.empty((count, len(slopes)))
    amount, mass, moment = (np.empty(count, np.float32) for _ in range(3))
    windows = TextWindows(
        *(address(array) for array in (at, du, dv, shifts, weights)),
        *(count, shape.rows, shape.columns, shape.margin, shape.strips, len(slopes)),
    )
    packed = np.ascontiguousarray(ink).view(np.uint8)
    image = image_of(packed)
    outputs = (address(array) for array in (energies, amount, mass, moment))
    if not kernels.measure_windows(ctypes.byref(image), ctypes.byref(windows), *outputs):
        raise MemoryError
    return WindowFigures(energies, amount, np.asarray(moment / np.maximum(mass, _LEAST_INK), np.float32))


def measure_windows_plain(
    ink: Mask, centres: Points, along: Floats, across: Floats, slopes: Vector, shape: WindowShape
) -> WindowFigures:
    """`measure_windows` without a kernel."""
    windows = sample_windows(ink.astype(np.float32), centres, along, across, (shape.rows, shape.columns))
    energies, amount = scan_slopes(windows, slopes, shape.margin, shape.strips)
    middle = windows[:, shape.margin : shape.rows - shape.margin]
    offset = np.arange(shape.columns, dtype=np.float32) - (shape.columns - 1) / 2
    mass = np.maximum(middle.sum(axis=(1, 2)), _LEAST_INK)
    return WindowFigures(
        energies, amount, np.asarray(np.einsum("nrc,c->n", middle, offset) / mass, np.float32)
    )


def _middles_of_strips(columns: int, strips: int) -> Vector:
    """Places (strips,) of the middles of strips, in columns from the windows' middle."""
    width = columns // strips
    return np.asarray((np.arange(strips) + 0.5) * width - 0.5 - (columns - 1) / 2)


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
) -> tuple[Energies, NDArray[np.float32]]:
    """Energies (N, S) of `windows` (N, rows, columns) projected along rows of slope `slopes` (S,).

    A window is first summed to `strips` column sums. A slope then only shifts these relative to each other, by cubic
    interpolation. Linear interpolation blurs at half rows and not at whole ones, which biases the peak to slope 0 (0.15
    degrees, measured). `margin` rows above and below allow for the shifts. Also returns the ink (N,) of the central
    rows.
    """
    count, rows, columns = windows.shape
    if count == 0:  # BLAS takes no empty vectors
        return np.empty((0, len(slopes))), np.zeros(0, np.float32)
    width = columns // strips
    sums = np.repeat(np.eye(strips, dtype=np.float32), width, axis=0)
    summed = windows[:, :, : width * strips].reshape(-1, width * strips) @ sums
    # Rows first, windows last: what is added up for a slope then lies together in memory.
    used = np.ascontiguousarray(summed.reshape(count, rows, strips).transpose(2, 1, 0))
    for _ in range(2):  # ink is binary; the smoothing makes the peak suitable for a parabola
        used[:, 1:-1] = 0.25 * used[:, :-2] + 0.5 * used[:, 1:-1] + 0.25 * used[:, 2:]
    offset_of = _middles_of_strips(columns, strips)
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


def catmull_rom(t: float | Floats) -> NDArray[np.float32]:
    """Weights (4, ...) of the samples at -1, 0, 1, 2 for the values at 0 <= t < 1, of any shape (...)."""
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
