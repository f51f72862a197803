"""Text lines traced by the profiles of their ink in a flat view that is not quite flat yet.

Where characters touch, or creases break a line, boxes of characters no longer chain. The darkness summed over a short
window of a line still has one ridge a line: its sides are the baseline and the x-height line. Ridges of neighbouring
windows are linked into lines, which may bend and jump in slope.
"""

import ctypes
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from services.arrays import Floats, GrayImage, Mask, Points, Vector
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.imaging.channels import only_where
from services.imaging.node_grid import take_values
from services.kernels.library import RidgeLinks, address, find_kernels
from services.order_statistics import median
from services.sheet.developable.observations import NO_LINES, LineObservations
from services.sheet.tracing.line_tracing import observe_lines, sampling_maps
from services.sheet.tracing.page_text import TracedText

PAPER_LEVEL = np.float32(235.0)
"""Of flat-fielded photos, whose bare paper is 255 but for noise."""
NO_RIDGE = -1
"""Before the first ridge of a line."""


# Lengths are multiples of the text height.
HEIGHT_PX = 10.0
"""Text height in the flat view: what is smaller is enlarged."""
WINDOW = 3.0
"""Length of a line that one profile sums up: half a word, so that no single letter decides."""
STEP = 1.5
SMOOTH = 0.3
"""Gaussian along the profile, which joins x-height and ascenders to one ridge."""
EDGE_SMOOTH = 0.12
CONTRAST = 0.25
"""Least height of a ridge above its two valleys, in darkness of the view's typical ridge."""
WAIT = 0.1
"""What a window without a ridge costs, as a distance: the nearest of two ridges is taken before a later one."""
DEVIATION = 0.05
"""Of an edge's place: what letters differ in by design, over one window."""
REACH = 2.0
"""The end of a line is searched this far beyond its last window."""
MAX_POINTS = 7000
"""Of all lines: of a dense page, windows are left out evenly."""
MAX_GROUPS = 8
"""Largest numbers of flush margins and of paragraphs that are used; those with most lines are kept."""


@dataclass(frozen=True, slots=True)
class ProfileParameters:
    """Lengths are multiples of the text height."""

    drift: float = 0.55
    """A line's ridge lies at most this far up or down in the next window; lines are 1.8 apart at least."""
    gap: int = 3
    """Windows that a line may miss: a wide word space, a crease's shadow."""
    bend: float = 0.5
    """How far the next ridge may be from where the last ones lead."""
    min_windows: int = 5


@dataclass(frozen=True, slots=True, eq=False)
class FlatGray:
    """Darkness (H, W), 0-1, of the text in a flat view; page point (u, v) lies at pixel (u, v) `scale` - `offset`."""

    darkness: NDArray[np.float32]
    scale: float
    offset: tuple[float, float]
    height_px: float
    """Text height in pixels of this view."""

    def to_page(self, pixels: Points) -> Points:
        """Page points (N, 2) of pixels (N, 2)."""
        return np.asarray((pixels + self.offset) / self.scale)


def flatten_darkness(
    gray: GrayImage,
    text_area: Mask,
    H_gray_centred: Floats,
    page_map: PageMap,
    text: Points,
    text_height: float,
) -> FlatGray | None:
    """Darkness of the flat-fielded `gray` within `text_area` in the flat view of `page_map`; None without text.

    `text` (N, 2) are characters and `text_height` their size, both in centred units.
    """
    page = page_map.to_page(text)
    known = np.isfinite(page).all(axis=1)
    if known.sum() < 10:
        return None
    page, J = page[known], page_map.jacobians(text[known])
    grow = float(np.sqrt(np.nanmedian(np.abs(np.linalg.det(J)))))
    low, high = np.percentile(page, 0.5, axis=0), np.percentile(page, 99.5, axis=0)
    margin = 3 * text_height * grow
    low, high = low - margin, high + margin
    scale = HEIGHT_PX / (text_height * grow)
    scale = min(scale, float(np.sqrt(8e6 / np.prod(high - low))))  # bounded for every model
    width, height = (max(int(np.ceil(v)), 1) for v in (high - low) * scale)
    offset = (float(low[0]) * scale, float(low[1]) * scale)
    area = text_area.astype(np.uint8) * 255
    darkness = np.zeros((height, width), np.float32)
    for band, at in sampling_maps(page_map, width, height, scale, offset, H_gray_centred):
        flat = take_values(gray, at, cv2.INTER_LINEAR, cv2.BORDER_CONSTANT, 255.0)
        inside = take_values(area, at, cv2.INTER_LINEAR, cv2.BORDER_CONSTANT) > 127
        darkness[band] = only_where(inside, darkness_of(flat))
    return FlatGray(darkness, scale, offset, text_height * grow * scale)


def darkness_of(levels: GrayImage) -> NDArray[np.float32]:
    """Darkness (H, W), 0-1, of flat-fielded `levels` (H, W): paper and all that is lighter than `PAPER_LEVEL` has 0."""
    table = np.clip((PAPER_LEVEL - np.arange(256, dtype=np.float32)) / PAPER_LEVEL, 0.0, 1.0)
    return np.asarray(cv2.LUT(levels, table), np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Ridges:
    """Ridges of all windows: window number, and pixel rows of the ridge, its upper and its lower edge."""

    window: NDArray[np.intp]
    middle: Vector
    crown: Vector
    base: Vector


def find_ridges(flat: FlatGray) -> tuple[Ridges, Vector]:
    """Ridges of the darkness in every window, and the windows' middle columns."""
    h = flat.height_px
    width, step = max(round(WINDOW * h), 3) | 1, max(round(STEP * h), 1)
    sums = cv2.blur(flat.darkness, (width, 1), borderType=cv2.BORDER_CONSTANT)
    columns = np.arange(step // 2, sums.shape[1], step)
    profiles = sums[:, columns]
    smooth = gaussian_filter1d(profiles, SMOOTH * h, axis=0, mode="constant")
    sharp = gaussian_filter1d(profiles, EDGE_SMOOTH * h, axis=0, mode="constant", order=1)
    inner = smooth[1:-1]
    peak = (inner > smooth[:-2]) & (inner >= smooth[2:])
    row, window = np.nonzero(peak)
    row += 1
    value = smooth[row, window]
    if not len(row):
        none = np.zeros(0)
        return Ridges(np.zeros(0, np.intp), none, none, none), columns.astype(np.float64)
    usual = float(np.percentile(value, 75))
    reach = max(round(0.9 * h), 2)
    last = smooth.shape[0] - 1
    offsets = np.arange(1, reach + 1)
    above = smooth[np.clip(row[:, None] - offsets, 0, last), window[:, None]].min(axis=1)
    below = smooth[np.clip(row[:, None] + offsets, 0, last), window[:, None]].min(axis=1)
    clear = value - np.maximum(above, below) > CONTRAST * usual
    row, window = row[clear], window[clear]
    crown = _extremum(sharp, row, window, -reach, 1)
    base = _extremum(-sharp, row, window, -1, reach)
    good = np.isfinite(crown) & np.isfinite(base) & (base - crown > 0.3 * h) & (base - crown < 1.7 * h)
    order = np.lexsort((row[good], window[good]))
    crown, base = crown[good][order], base[good][order]
    return Ridges(window[good][order], 0.5 * (crown + base), crown, base), columns.astype(np.float64)


def _extremum(slopes: Floats, row: NDArray[np.intp], window: NDArray[np.intp], low: int, high: int) -> Vector:
    """Row, to a fraction, of the greatest of `slopes` between `row` + `low` and `row` + `high`; NaN at an end."""
    offsets = np.arange(low, high + 1)
    rows = row[:, None] + offsets
    last = slopes.shape[0] - 1
    values = slopes[np.clip(rows, 0, last), window[:, None]]
    best = np.argmax(values, axis=1)
    inside = (best > 0) & (best < len(offsets) - 1)
    k, n = np.clip(best, 1, len(offsets) - 2), np.arange(len(row))
    a, b, c = values[n, k - 1], values[n, k], values[n, k + 1]
    bend = a - 2 * b + c
    shift = np.where(np.abs(bend) > 1e-12, 0.5 * (a - c) / np.where(np.abs(bend) > 1e-12, bend, 1.0), 0.0)
    return np.where(inside, rows[n, k] + np.clip(shift, -1, 1), np.nan)


def link_ridges(ridges: Ridges, height_px: float, p: ProfileParameters) -> list[NDArray[np.intp]]:
    """Members of every line, from left to right: successive ridges, each the best match of the other."""
    kernels = find_kernels()
    if kernels is None:
        return link_ridges_plain(ridges, height_px, p)
    window = np.ascontiguousarray(ridges.window, np.int64)
    y = np.ascontiguousarray(ridges.middle, np.float64)
    if window.shape != y.shape or (np.diff(window) < 0).any():
        raise ValueError("ridges come by their windows")
    before, length, tails = np.empty((3, len(window)), np.int64)
    bends = (p.bend * height_px, p.drift * height_px, WAIT * height_px)
    linked = RidgeLinks(address(window), address(y), len(window), p.gap, *bends)
    lines = kernels.link_ridges(ctypes.byref(linked), *map(address, (before, length, tails)))
    if lines < 0:
        raise MemoryError
    return [_members(tail, before) for tail in tails[:lines][length[tails[:lines]] >= p.min_windows].tolist()]


def link_ridges_plain(ridges: Ridges, height_px: float, p: ProfileParameters) -> list[NDArray[np.intp]]:
    """`link_ridges` by NumPy: the same."""
    window, y = ridges.window, ridges.middle
    if not len(window):
        return []
    starts = np.searchsorted(window, np.arange(int(window.max()) + 2))
    before = np.full(len(window), NO_RIDGE)
    tails = np.zeros(0, np.intp)
    done: list[NDArray[np.intp]] = []
    for w in range(len(starts) - 1):
        new = np.arange(starts[w], starts[w + 1])
        lost = w - window[tails] > p.gap
        done.append(tails[lost])
        tails = tails[~lost]
        free = np.ones(len(new), bool)
        if len(tails) and len(new):
            ago = w - window[tails]
            led = y[tails] + _slopes(tails, before, window, y) * ago
            apart = np.abs(y[new][None] - led[:, None])
            moved = np.abs(y[new][None] - y[tails][:, None])
            fits = (apart < p.bend * height_px) & (moved < p.drift * height_px * ago[:, None])
            cost = np.where(fits, apart + WAIT * height_px * ago[:, None], np.inf)
            match = cost.argmin(axis=1)
            mutual = np.isfinite(cost.min(axis=1)) & (cost.argmin(axis=0)[match] == np.arange(len(tails)))
            linked = new[match[mutual]]
            before[linked] = tails[mutual]
            tails[mutual] = linked
            free[match[mutual]] = False
        tails = np.concatenate([tails, new[free]])
    lines = (_members(int(tail), before) for tail in np.concatenate([*done, tails]))
    return [members for members in lines if len(members) >= p.min_windows]


def _slopes(tails: NDArray[np.intp], before: NDArray[np.intp], window: NDArray[np.intp], y: Vector) -> Vector:
    """How far lines go down from one window to the next by their last few ridges, whose last ones are `tails` (N,)."""
    second = before[tails]
    third = np.where(second >= 0, before[second], NO_RIDGE)
    fourth = np.where(third >= 0, before[third], NO_RIDGE)
    first = np.where(fourth >= 0, fourth, third)
    slopes = (y[tails] - y[first]) / np.maximum(window[tails] - window[first], 1)
    return np.where(third >= 0, slopes, 0.0)


def _members(tail: int, before: NDArray[np.intp]) -> NDArray[np.intp]:
    """The ridges of the line that ends with `tail`, from left to right."""
    members = [tail]
    while (tail := int(before[tail])) != NO_RIDGE:
        members.append(tail)
    return np.array(members[::-1], np.intp)


def trace_by_profiles(text: TracedText, view: PhotoFrame, page_map: PageMap) -> LineObservations:
    """The page's text lines, traced by profiles in the flat view of `page_map`, in centred coordinates."""
    characters, height = view.to_centred(text.characters), text.height_px / view.unit_px
    flat = flatten_darkness(
        text.gray, text.filled_area, text.H_reduced_centred(view), page_map, characters, height
    )
    return NO_LINES if flat is None else trace_profiles(flat, page_map)


def trace_profiles(flat: FlatGray, page_map: PageMap) -> LineObservations:
    """Observations of all text lines of the flat view, in centred coordinates of the photo."""
    p = ProfileParameters()
    h = flat.height_px
    ridges, columns = find_ridges(flat)
    chains = link_ridges(ridges, h, p)
    if not chains:
        return NO_LINES
    pieces: list[Floats] = []
    index: list[NDArray[np.intp]] = []
    ends = []
    thin = max(-(-2 * sum(len(members) for members in chains) // MAX_POINTS), 1)
    for k, members in enumerate(chains):
        x = columns[ridges.window[members]]
        for edge, y in enumerate((ridges.base[members], ridges.crown[members])):
            pieces.append(np.stack([x, y], axis=1)[k % thin :: thin])
            index.append(np.full(len(pieces[-1]), 2 * k + edge))
        ends.append(_line_ends(flat, x, ridges.crown[members], ridges.base[members]))
    pixels = np.concatenate(pieces)
    deviations_px = np.full(len(pixels), DEVIATION * h)
    return observe_lines(
        pixels,
        np.concatenate(index),
        deviations_px,
        np.array(ends),
        page_map,
        flat.scale,
        flat.offset,
        MAX_GROUPS,
    )


def _line_ends(
    flat: FlatGray, x: Vector, crown: Vector, base: Vector
) -> tuple[float, float, float, float, float]:
    """First and last inked column of a line with its baseline there, and the line's height."""
    h = flat.height_px
    first = max(int(x[0] - REACH * h), 0)
    last = min(int(x[-1] + REACH * h), flat.darkness.shape[1] - 1)
    at = np.arange(first, last + 1)
    top, bottom = (np.interp(at, x, y).round().astype(int) for y in (crown, base))
    middle = (top + bottom) // 2
    rows = np.clip(np.stack([top, middle, bottom - 1]), 0, flat.darkness.shape[0] - 1)
    inked = np.flatnonzero(flat.darkness[rows, at].max(axis=0) > 0.3)
    begin, end = (at[inked[0]], at[inked[-1]]) if len(inked) else (at[0], at[-1])
    y = np.interp([begin, end], x, base)
    return float(begin), float(y[0]), float(end), float(y[1]), median(base - crown)
