"""The gutter between the two pages of an opened book, and how it differs from the gap between two columns."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, RgbImage, Vector
from services.geometry.homographies import to_resized
from services.imaging.channels import log_brightness
from services.imaging.long_edges import LONG_SIDE_PX
from services.imaging.reduction import reduce_image
from services.robust import cauchy_weights, fit_reweighted
from services.texture_flow.field import FlowSamples, angle_difference

# Lengths are multiples of the text height, contrasts differences of the logarithm of brightness.
JUMP_RANGE = (1.0, 30.0)
"""Distances from the gutter within which directions are compared."""
MIN_SAMPLES = 4
MANY_SAMPLES = 12
"""From here on a side's directions are continued to the gutter by a quadratic: near a gutter pages bend, and
a linear continuation has errors of ten degrees."""
SPREAD_RAD = 0.05
"""Of directions about their fit; more is an outlier."""
ROW_HEIGHT = 2.0
"""Height of the rows in which the text on both sides is compared."""
GAP_PERCENTILE = 30.0
"""Of the rows: short lines leave wider gaps."""
MIN_ROWS = 4
LARGEST_SLOPE = 0.4
"""Of a gutter against the strokes, at most, either way; perspective makes this much."""
SLOPE_STEPS = 33
PAGE_GAP = 5.0
"""Least gap between two pages, as `row_gap` measures it: two margins. On simulated photos columns have 0.9 to 4.5, two
pages 5.1 to 12."""
CLOSE_GAP = 4.0
"""Least gap where the gutter is as dark as `close_dip`: in thick books the margins bend down into it."""
CLOSE_DIP = 0.25
LEAST_BAND = 3.5
"""Least width of a straight band without text in the gap: headings and formulas extend into the margins."""
STRAY_SHARE = 0.003
"""Largest share of the characters in the gap (specks, marginal notes)."""
PAGE_SHARE = 0.12
"""A smaller share of the characters is not a page."""
LIKELY_SHARE = 0.6
"""Gaps wider than this share of the widest one are candidates too."""
DIP = 0.1
"""A gutter is darker than the paper on both sides by this, at least. Simulated ones are by 0.26 to 1.1; gaps on
creased sheets, at which lines turn as they do at a gutter, by 0.03."""
TURN_RAD = float(np.deg2rad(4.0))
"""Where several gaps are dark, a turn of the lines by this says as much as `dip`."""
CLEAR_GAP = 1.5
"""A gutter that is not dark is wider than all other gaps by this factor: columns have gaps of one width."""
CENTRAL = 0.1
"""Its distance from the middle of the text, as a share of the text's width, at most."""
PAGE_ASPECTS = (0.5, 1.0)
"""Width over height of the photo's part on either side of it; half of an upright sheet of paper is narrower."""
PAPER_PERCENTILE = 75.0
"""Of the brightness along a line through text: paper."""


@dataclass(frozen=True, slots=True, eq=False)
class Gutter:
    """The line between two pages: `line` (2, 2) in photo pixels; `right` (N,) marks the characters beyond it.

    `dip` is how much darker it is than the paper on both sides, `jump_rad` how much the text lines turn at it.
    """

    line: Points
    right: NDArray[np.bool_]
    dip: float
    jump_rad: float


def row_gap(distances: Vector, rows: Vector, text_height: float) -> float:
    """Typical gap across a line between the text on both sides of it, in text heights.

    `distances` (N,) of characters from the line are signed, `rows` (N,) are along it; both in pixels. Infinite where
    too few rows have text on both sides.
    """
    row = np.floor((rows - rows.min()) / (ROW_HEIGHT * text_height)).astype(int)
    right = np.full(row.max() + 1, np.inf)
    left = right.copy()
    np.minimum.at(right, row[distances > 0], distances[distances > 0])
    np.minimum.at(left, row[distances <= 0], -distances[distances <= 0])
    gaps = (left + right)[np.isfinite(left + right)]
    if len(gaps) < MIN_ROWS:
        return float("inf")
    return float(np.percentile(gaps, GAP_PERCENTILE)) / text_height


def direction_jump(distances: Vector, rows: Vector, flow: FlowSamples, text_height: float) -> float:
    """Change of the text lines' direction (rad) across a line, each side's continued to it smoothly.

    `distances` (M,) of the samples of `flow` from the line are signed, `rows` (M,) are along it. 0 where one side has
    too few samples.
    """
    near, far = (v * text_height for v in JUMP_RANGE)
    ends, spans = [], []
    for sign in (-1, 1):
        away = sign * distances
        used = (away > near) & (away < far)
        if used.sum() < MIN_SAMPLES:
            return 0.0
        ends.append(_continue_directions(away[used] / far, rows[used] / far, flow.select(used)))
        spans.append((rows[used].min(), rows[used].max()))
    low, high = max(spans[0][0], spans[1][0]), min(spans[0][1], spans[1][1])
    at = np.linspace(low, high, 9) if high > low else np.array([0.5 * (low + high)])
    left, right = (angle + slope * (at / far - middle) for angle, slope, middle in ends)
    return float(np.median(np.abs(angle_difference(left, right))))


def _continue_directions(away: Vector, rows: Vector, flow: FlowSamples) -> tuple[float, float, float]:
    """Direction at `away` = 0, its slope along the rows, and the row of that direction, by a robust smooth fit."""
    reference = 0.5 * float(np.angle(np.sum(flow.weights * np.exp(2j * flow.angles))))
    middle = float(np.median(rows))
    terms = [np.ones_like(away), away, rows - middle]
    if len(away) >= MANY_SAMPLES:
        terms += [away**2, away * (rows - middle)]
    design = np.stack(terms, axis=1)
    # All coefficients but the first are damped a little: few samples do not determine them.
    held = np.diag([1e-6, *[0.1 if len(terms) > 3 else 0.3] * (len(terms) - 1)])
    value = angle_difference(flow.angles, reference)
    c = fit_reweighted(
        design, value, cauchy_weights, lambda *_: SPREAD_RAD, 4, weights=flow.weights, damping=held
    )
    return reference + float(c[0]), float(c[2]), middle


def find_gutter(
    photo: RgbImage, characters: Points, text_height: float, flow: FlowSamples, direction_rad: float
) -> Gutter | None:
    """Find the gutter of an opened book: a dark straight line in a gap between the text of two pages.

    Of several dark gaps the one with most evidence is returned: its darkness, and the turn of the text lines at it.
    Where none is dark, as in flat scans, it is the widest gap, if this divides the photo into two parts like pages.

    Parameters
    ----------
    photo
        (H, W, 3) RGB.
    characters
        (N, 2) centres in photo pixels.
    text_height
        Size of the characters in pixels.
    flow
        Major flow in photo pixels.
    direction_rad
        Mean direction of the text lines; the gutter is across it.

    Returns
    -------
    Gutter or None
        None if no gap between text is dark, or divides the photo like a book.
    """
    cos, sin = np.cos(direction_rad), np.sin(direction_rad)
    turn = np.array([[cos, sin], [-sin, cos]])
    at, samples = characters @ turn.T, flow.points @ turn.T
    found = _gaps(at, text_height)
    if not found:
        return None
    widest = max(high - low for _, low, high in found)
    factor = min(1.0, LONG_SIDE_PX / max(photo.shape[:2]))
    brightness = log_brightness(reduce_image(photo, factor, least_side_px=8, fine=False))
    gutters: list[tuple[float, Gutter]] = []
    widths = []
    for slope, low, high in found:
        if high - low < LIKELY_SHARE * widest:
            continue
        place, dip = _darkest(brightness, factor, turn, slope, (low, high), at)
        away, across = (v[:, 0] - slope * v[:, 1] - place for v in (at, samples))
        gap = row_gap(away, at[:, 1], text_height)
        widths.append(gap)
        if gap < (CLOSE_GAP if dip > CLOSE_DIP else PAGE_GAP):
            continue
        jump = direction_jump(across, samples[:, 1], flow, text_height)
        reach = float(np.hypot(*photo.shape[:2]))
        ends = np.array([at[:, 1].min() - reach, at[:, 1].max() + reach])
        line = np.column_stack([place + slope * ends, ends]) @ turn
        gutters.append((gap, Gutter(np.asarray(line), np.asarray(away > 0), dip, jump)))
    dark = [gutter for _, gutter in gutters if gutter.dip > DIP]
    if dark:
        return max(dark, key=lambda gutter: gutter.dip / DIP + gutter.jump_rad / TURN_RAD)
    clear = [gutter for gap, gutter in gutters if np.isfinite(gap) and _is_widest(gap, widths)]
    frame = np.array([[0, 0], [photo.shape[1], 0], [0, photo.shape[0]], photo.shape[1::-1]]) @ turn.T
    return next((gutter for gutter in clear if _divides_pages(gutter.line @ turn.T, at, frame)), None)


def _is_widest(gap: float, gaps: list[float]) -> bool:
    """Whether `gap` is clearly wider than all others of the `gaps`."""
    return sum(other > gap / CLEAR_GAP for other in gaps) == 1


def _divides_pages(ends: Points, at: Points, frame: Points) -> bool:
    """Whether the line between `ends` (2, 2) divides text and photo in the middle, into parts like pages.

    `at` (N, 2) are the characters and `frame` (4, 2) the photo's corners; lines of text are level.
    """
    place = float(np.interp(np.median(at[:, 1]), ends[:, 1], ends[:, 0]))
    first, last = (float(v) for v in np.percentile(at[:, 0], [1, 99]))
    (left, top), (right, bottom) = frame.min(axis=0), frame.max(axis=0)
    central = abs(place - 0.5 * (first + last)) < CENTRAL * (last - first)
    low, high = PAGE_ASPECTS
    like_pages = all(low < width / (bottom - top) < high for width in (place - left, right - place))
    return central and like_pages


def _gaps(at: Points, text_height: float) -> list[tuple[float, float, float]]:
    """Slopes, and bounds of x - slope y, of the empty bands between characters `at` (N, 2) that may be gutters.

    Of each band at neighbouring slopes only the widest.
    """
    strays = int(STRAY_SHARE * len(at))
    first, last = int(PAGE_SHARE * len(at)), int((1 - PAGE_SHARE) * len(at))
    bands: list[tuple[float, float, float]] = []
    for slope in np.linspace(-LARGEST_SLOPE, LARGEST_SLOPE, SLOPE_STEPS):
        x = np.sort(at[:, 0] - slope * (at[:, 1] - np.median(at[:, 1])))
        width = x[strays + 1 :] - x[: len(x) - strays - 1]
        for k in np.flatnonzero(width > LEAST_BAND * text_height):
            if first <= k <= last:
                shift = slope * float(np.median(at[:, 1]))
                bands.append((float(slope), float(x[k]) - shift, float(x[k + strays + 1]) - shift))
    bands.sort(key=lambda band: band[1] - band[2])
    middle_row = float(np.median(at[:, 1]))
    kept: list[tuple[float, float, float]] = []
    for slope, low, high in bands:
        centre = 0.5 * (low + high) + slope * middle_row
        others = [0.5 * (a + b) + s * middle_row for s, a, b in kept]
        if all(abs(centre - other) > PAGE_GAP * text_height for other in others):
            kept.append((slope, low, high))
    return kept


def _darkest(
    brightness: Floats, factor: float, turn: Floats, slope: float, band: tuple[float, float], at: Points
) -> tuple[float, float]:
    """The darkest line within a band (x - slope y between its bounds), and its contrast to the paper on both sides.

    Where nothing is darker than both sides, the middle of the band.
    """
    low, high = band
    reach = 0.5 * (high - low)
    count = max(int((high - low + 2 * reach) * factor), 24)
    x = np.linspace(low - reach, high + reach, count)
    first, last = (float(v) for v in np.percentile(at[:, 1], [3, 97]))
    y = np.linspace(first, last, 200)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    grid[..., 0] += slope * grid[..., 1]
    seen = np.asarray(to_resized(grid.reshape(-1, 2) @ turn, factor).reshape(*grid.shape), np.float32)
    values = cv2.remap(
        brightness, seen[..., 0], seen[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    paper = np.percentile(values, PAPER_PERCENTILE, axis=0)
    inside = np.flatnonzero((x >= low) & (x <= high))
    # Of a few columns on either side the brightest: a gutter has two brighter sides, the edge of a shadow has one.
    depth = [min(paper[: k + 1].max(), paper[k:].max()) - paper[k] for k in inside]
    best = int(np.argmax(depth))
    if depth[best] <= 0:
        return 0.5 * (low + high), 0.0
    return float(x[inside[best]]), float(depth[best])
