"""Major texture flow: the local direction of text lines (dissertation 2.3.2)."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Mask, Points, Vector
from services.geometry.homographies import to_resized
from services.texture_flow.field import FlowField, FlowSamples, angle_difference
from services.texture_flow.projection_profiles import (
    WindowShape,
    measure_windows,
    parabola_peak,
    scan_directions,
)
from services.texture_flow.regression import OUTLIER_RAD, reject_outliers, smooth_samples
from services.texture_flow.relaxation import find_peaks, label_by_relaxation
from services.texture_flow.text_identification import IdentifiedText

# Lengths are multiples of the text height.
COARSE_TEXT_HEIGHT_PX = 3.5
"""The coarse scan works on ink reduced until characters have this size."""
COARSE_WINDOW = (12.0, 9.0)
CANDIDATES = 4
ITERATIONS = 10
FINE_BLOCK = 3.0
FINE_WINDOW = (14.0, 8.0)
FINE_RANGE_RAD = np.deg2rad(6.0)
ALONG_SAMPLING = 5.0
STRIPS = 12
REMEASURE_SLOPE = np.tan(np.deg2rad(3.0))
REMEASURE_RAD = np.deg2rad(1.5)
WIDE_RANGE_RAD = np.deg2rad(15.0)
"""For windows measured again: at a bent page's edge, lines turn by 20 degrees within a window's width."""
SMOOTHING = 6.0
"""Of the field that neighbours are judged by: with 5 the gutter of a book was lost."""
FIELD_SMOOTHING = 5.0


@dataclass(frozen=True, slots=True)
class MajorFlowParameters:
    """Lengths are multiples of the text height."""

    coarse_block: float = 5.0
    coarse_step_rad: float = np.deg2rad(5.0)
    fine_step_rad: float = np.deg2rad(0.75)
    across_sampling: float = 12.0
    """Samples a text height, so that work does not grow with the size of the print; along the lines few are enough."""
    max_samples: int = 600
    """Bound on the fine samples: the blocks grow until there are at most this many."""
    repeats: int = 2
    field_spacing: float = 2.0
    """Of the dense field, which follows a bent page to second order."""
    barred_rad: float | None = None
    """A direction along which no lines run: those of the text cross it by 45 degrees at least."""


@dataclass(frozen=True, slots=True)
class _Window:
    """Sampling of the fine windows: steps in pixels, and the shape."""

    along_px: float
    across_px: float
    shape: WindowShape


@dataclass(frozen=True, slots=True, eq=False)
class MajorFlow:
    """Fine samples E_2^M and the dense field E^M, in the frame of the analysed image."""

    samples: FlowSamples
    field: FlowField


def block_centres(
    area: NDArray[np.bool_], block_px: float, max_count: int | None = None
) -> tuple[Points, tuple[int, int]]:
    """Centres (rows * columns, 2) of blocks that tile the image, row by row, and the grid's (rows, columns)."""
    height, width = area.shape
    while True:
        rows, columns = max(int(height / block_px), 1), max(int(width / block_px), 1)
        x = (np.arange(columns) + 0.5) * width / columns - 0.5
        y = (np.arange(rows) + 0.5) * height / rows - 0.5
        grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        at = np.round(grid).astype(int)
        if max_count is None or area[at[:, 1], at[:, 0]].sum() <= max_count:
            return grid, (rows, columns)
        block_px *= 1.15


def detect_coarse_flow(text: IdentifiedText, parameters: MajorFlowParameters | None = None) -> FlowSamples:
    """Coarse major directions E_0^M on a grid of nodes, by K candidate peaks and relaxation labelling.

    The text takes the second-best labels for the minor flow; strokes do not line up across text lines, so these were
    6 to 18 degrees off (median) and the minor flow starts from its own strength curves instead.
    """
    p = parameters or MajorFlowParameters()
    unit = text.text_height_px
    scale = min(COARSE_TEXT_HEIGHT_PX / unit, 1.0)
    # Beyond a window's reach from all print, images hold nothing.
    x, y, columns, rows = cv2.boundingRect(text.ink.view(np.uint8))
    margin = int(np.ceil(max(COARSE_WINDOW) * unit))
    first = np.maximum([x - margin, y - margin], 0)
    last = np.minimum([x + columns + margin, y + rows + margin], text.ink.shape[::-1])
    printed = text.ink[first[1] : last[1], first[0] : last[0]].astype(np.float32)
    ink = np.asarray(cv2.resize(printed, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.float32)
    # Grids of a page-filling headline or of dust alike stay bounded.
    block = max(p.coarse_block * unit, max(text.ink.shape) / 64)
    centres, grid = block_centres(text.area, block)
    reduced = to_resized(centres - first, scale)
    window = (COARSE_WINDOW[0] * unit * scale, COARSE_WINDOW[1] * unit * scale)
    presence = cv2.blur(ink, tuple(int(w) | 1 for w in window), borderType=cv2.BORDER_CONSTANT)
    at = np.round(reduced).astype(int)
    within = ((at >= 0) & (at < ink.shape[::-1])).all(axis=1)
    amount = np.zeros(len(at), np.float32)
    amount[within] = presence[at[within, 1], at[within, 0]]
    alive = amount > 0.25 * float(np.median(amount[amount > 0])) if (amount > 0).any() else amount > 0
    quarter = np.arange(0.0, np.pi / 2 - 1e-9, p.coarse_step_rad)
    angles = np.concatenate([quarter, quarter + np.pi / 2])
    energies = np.zeros((len(centres), len(angles)))
    energies[alive] = scan_directions(ink, reduced[alive], quarter, window)
    if p.barred_rad is not None:
        energies[:, np.abs(angle_difference(angles, p.barred_rad)) < np.pi / 4] = 0.0
    candidates = find_peaks(energies.reshape(*grid, -1), angles, CANDIDATES)
    confidence = label_by_relaxation(candidates, ITERATIONS)
    best = np.argmax(confidence, axis=-1)[..., None]
    energy = np.take_along_axis(candidates.energies, best, axis=-1).ravel()
    angle = np.take_along_axis(candidates.angles, best, axis=-1).ravel()
    trust = np.take_along_axis(confidence, best, axis=-1).ravel()
    top = float(energy.max()) if energy.size and energy.max() > 0 else 1.0
    samples = FlowSamples(centres, angle, trust * energy / top)
    return samples.select(energy > 0)


def refine_major_flow(
    text: IdentifiedText, coarse: FlowSamples, parameters: MajorFlowParameters | None = None
) -> MajorFlow:
    """Fine major flow: the profile's peak within a few degrees of the coarse field, at finer blocks."""
    p = parameters or MajorFlowParameters()
    unit = text.text_height_px
    shape = (text.ink.shape[0], text.ink.shape[1])
    sigma = SMOOTHING * unit
    kept = reject_outliers(coarse, 2 * sigma, shape, 3 * OUTLIER_RAD)
    field = smooth_samples(kept, shape, sigma, 2 * sigma)
    centres, _ = block_centres(text.area, FINE_BLOCK * unit, p.max_samples)
    at = np.round(centres).astype(int)
    centres = centres[text.area[at[:, 1], at[:, 0]]]
    along, across = unit / ALONG_SAMPLING, unit / p.across_sampling
    columns = int(FINE_WINDOW[0] * unit / along / STRIPS) * STRIPS
    slopes = np.tan(np.arange(-FINE_RANGE_RAD, FINE_RANGE_RAD + 1e-9, p.fine_step_rad))
    wide_slopes = np.tan(np.arange(-WIDE_RANGE_RAD, WIDE_RANGE_RAD + 1e-9, p.fine_step_rad))

    def window_for(slopes: Vector) -> _Window:
        margin = int(np.ceil(columns / 2 * abs(slopes[0]) * along / across)) + 4
        rows = int(FINE_WINDOW[1] * unit / across) + 2 * margin
        return _Window(along, across, WindowShape(rows, columns, margin, STRIPS))

    theta = field.at(centres)
    slope, inner, weight, places = _measure_slopes(text.ink, centres, theta, slopes, window_for(slopes))
    # Where the coarse field was off, the window is turned by what its neighbours found and measured once more.
    for _ in range(p.repeats):
        samples = _fine_samples(places, theta, slope, np.where(inner, weight, 0.0))
        samples = reject_outliers(samples, sigma, shape, OUTLIER_RAD, order=2)
        if not len(samples):
            break
        dense = smooth_samples(samples, shape, p.field_spacing * unit, FIELD_SMOOTHING * unit, order=2)
        expected = dense.at(places)
        found = theta + np.arctan(slope)
        off = np.abs(angle_difference(found, expected)) > REMEASURE_RAD
        again = (np.abs(slope) > REMEASURE_SLOPE) | off | ~inner
        if not again.any():
            return MajorFlow(samples, dense)
        theta[again] = expected[again]
        measured = _measure_slopes(
            text.ink, centres[again], theta[again], wide_slopes, window_for(wide_slopes)
        )
        slope[again], inner[again], weight[again], places[again] = measured
    samples = _fine_samples(places, theta, slope, np.where(inner, weight, 0.0))
    samples = reject_outliers(samples, sigma, shape, OUTLIER_RAD, order=2)
    field = smooth_samples(samples, shape, p.field_spacing * unit, FIELD_SMOOTHING * unit, order=2)
    return MajorFlow(samples, field)


def _fine_samples(places: Points, theta: Vector, slope: Vector, weight: Vector) -> FlowSamples:
    """Samples at `places` (N, 2) of slopes against the windows' directions `theta`, without those that saw nothing."""
    top = float(np.median(weight[weight > 0])) if (weight > 0).any() else 1.0
    angle = (theta + np.arctan(slope) + np.pi / 2) % np.pi - np.pi / 2
    samples = FlowSamples(places, angle, np.clip(weight / top, 0, 1))
    return samples.select(samples.weights > 0.05)


def _measure_slopes(
    ink: Mask, centres: Points, theta: Vector, slopes: Vector, window: _Window
) -> tuple[Vector, NDArray[np.bool_], Vector, Points]:
    """Slope of the profile's peak against `theta`, whether it is an inner peak, its weight and place, for every window.

    The place is the centroid of the ink: a window that reaches beyond the ends of its lines shows their direction
    not in its middle but where they are.
    """
    along = window.along_px * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    across = window.across_px * np.stack([-np.sin(theta), np.cos(theta)], axis=1)
    rows_per_column = slopes * window.along_px / window.across_px
    energies, amount, aside = measure_windows(ink, centres, along, across, rows_per_column, window.shape)
    slope, inner = parabola_peak(energies, slopes)
    mean = energies.mean(axis=1)
    contrast = (energies.max(axis=1) - energies.min(axis=1)) / np.where(mean > 0, mean, 1.0)
    places = centres + aside[:, None] * along
    return slope, inner, np.clip(contrast / 0.6, 0, 1) * amount, places
