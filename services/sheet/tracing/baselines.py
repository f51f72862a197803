"""Baselines of the text in a nearly flat view, paragraphs of equal spacing, flush margins."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from services.arrays import Floats, Mask, Points, Vector
from services.geometry.linked_groups import group_linked
from services.imaging.components import component_boxes
from services.order_statistics import median
from services.robust import geman_mcclure_weights

EDGE_ROUNDS = 10
"""Of the reweighted fits, in which the scale narrows from the first to the last."""
LEAST_SLOPE_WEIGHT = 1e-9
"""Squares of the slope that are added, in characters."""
BATCH = 200_000
"""Characters, gaps in the table included, that are fitted at once: bounds the memory."""


# Lengths are multiples of the text height.
REACH = 2.2
"""A character's right neighbour begins nearer than this (a wide word space)."""
DRIFT = 0.45
"""Bottoms of neighbours differ by less, unless one has a descender."""
SIZE_RATIO = 3.0
MIN_CHARACTERS = 6
MIN_LENGTH = 6.0
"""Of a line of text, a row or a rule."""
ALIKE = 0.05
"""Paragraphs whose spacing differs by less, relatively, have the same."""
BASELINE_SCALE = 0.08
"""Scale of Geman and McClure's loss of the baseline fit; descenders are outliers."""


@dataclass(frozen=True, slots=True, eq=False)
class Baselines:
    """Baselines in the flat view's frame, one row each, from top to bottom.

    `starts`, `ends` (L, 2) are the baseline at the left- and rightmost character, `heights` (L,) the median
    character height, `deviations` (L,) the standard deviation in pixels of either end of the baseline.
    """

    starts: Points
    ends: Points
    heights: Vector
    deviations: Vector

    def __len__(self) -> int:
        return len(self.heights)

    def level_within(self, angle_rad: float) -> bool:
        """Whether there are lines, and nine of ten are inclined by at most this."""
        run, rise = (self.ends - self.starts).T
        return len(self) > 0 and float(np.percentile(np.abs(np.arctan2(rise, run)), 90)) <= angle_rad


@dataclass(frozen=True, slots=True, eq=False)
class Paragraph:
    """Lines of one spacing: `lines` (n,) are row numbers of `Baselines`, `order` (n,) their line numbers."""

    lines: NDArray[np.intp]
    order: NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class CharacterRows:
    """Characters of a nearly flat view, and which of them form text lines.

    `left`, `right`, `top`, `bottom` (N,) are the sides of their boxes in pixels, `rows` the members of each line.
    """

    left: Vector
    right: Vector
    top: Vector
    bottom: Vector
    rows: list[NDArray[np.intp]]


def chain_characters(ink: Mask) -> CharacterRows:
    """Characters of `ink` (H, W), chained from left to right into text lines."""
    return chain_boxes(component_boxes(ink).astype(np.float64))


def chain_boxes(boxes: Floats) -> CharacterRows:
    """Characters of `boxes` (N, 4), left, top, width and height in pixels, chained from left to right into lines.

    Those much smaller or larger than most are left out.
    """
    x0, y0, width, height = boxes.T
    unit = float(np.median(height[height > 3])) if (height > 3).any() else 0.0
    usable = (height > 0.5 * unit) & (height < 4 * unit) & (width < 40 * unit)
    if unit == 0.0 or usable.sum() < MIN_CHARACTERS:
        return CharacterRows(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0), [])
    x0, y0, width, height = x0[usable], y0[usable], width[usable], height[usable]
    x1, bottom = x0 + width, y0 + height
    source, target = _right_neighbours(x0, x1, bottom, height)
    label = group_linked(len(x0), source, target)
    order = np.argsort(label, kind="stable")
    chains = np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
    rows = [members for members in chains if len(members) >= MIN_CHARACTERS]
    return CharacterRows(x0, x1, y0, bottom, rows)


def detect_baselines(ink: Mask) -> Baselines:
    """Text lines of `ink` (H, W) in a view whose lines are horizontal within about a degree."""
    return fit_baselines(chain_characters(ink))


def fit_baselines(found: CharacterRows) -> Baselines:
    """Baselines of rows of characters that are straight and horizontal within about a degree."""
    if not found.rows:
        return _no_lines()
    rows = sorted(found.rows, key=len)
    batches, first = [], 0
    for k in range(1, len(rows) + 1):
        if k == len(rows) or (k + 1 - first) * len(rows[k]) > BATCH:
            batches.append(_fit_lines(replace(found, rows=rows[first:k])))
            first = k
    table = np.concatenate(batches)
    table = table[table[:, 2] - table[:, 0] >= MIN_LENGTH * table[:, 4]]
    table = table[np.argsort(table[:, 1] + table[:, 3])]
    return Baselines(table[:, 0:2], table[:, 2:4], table[:, 4], table[:, 5])


def _no_lines() -> Baselines:
    return Baselines(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), np.zeros(0))


def _right_neighbours(
    x0: Vector, x1: Vector, bottom: Vector, height: Vector
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs (character, its neighbour to the right on the same line)."""
    unit = float(np.median(height))
    # Neighbours are searched in a frame stretched across the lines, from right end to left end.
    tree = cKDTree(np.stack([x0, 2.5 * bottom], axis=1))
    k = min(10, len(x0))
    distance, index = tree.query(
        np.stack([x1, 2.5 * bottom], axis=1), k=k, distance_upper_bound=REACH * unit * 2
    )
    found = np.isfinite(distance)
    index = np.where(found, index, 0)
    gap = x0[index] - x1[:, None]
    taller = np.maximum(height[index], height[:, None])
    smaller = np.minimum(height[index], height[:, None])
    rise = np.abs(bottom[index] - bottom[:, None])
    fits = (
        found
        & (gap > -0.6 * unit)
        & (x0[index] > x0[:, None])
        & (gap < REACH * np.maximum(smaller, unit))
        & (rise < DRIFT * taller)
        & (taller < SIZE_RATIO * smaller)
    )
    cost = np.where(fits, np.maximum(gap, 0) + 2.5 * rise, np.inf)
    best = np.argmin(cost, axis=1)
    source = np.flatnonzero(np.isfinite(cost[np.arange(len(x0)), best]))
    return source, index[source, best[source]]


def _fit_lines(characters: CharacterRows) -> Floats:
    """Of each line of characters that has one (n, 6): both ends of its baseline, character height, end deviation.

    Its slope is the mean of baseline and x-height line: a threshold that thickens strokes moves the two apart,
    more so where characters are small, and the mean is free of that. All lines are fitted at once.
    """
    rows = characters.rows
    size = np.array([len(row) for row in rows])
    present = np.arange(size.max()) < size[:, None]
    member = np.zeros(present.shape, np.intp)
    member[present] = np.concatenate(rows)
    left, right, top, bottom = (
        side[member] for side in (characters.left, characters.right, characters.top, characters.bottom)
    )
    unit = np.array([median(high[:n]) for high, n in zip(bottom - top, size, strict=True)])
    x = 0.5 * (left + right)
    middle = (x * present).sum(axis=1) / size
    spread = np.sqrt((((x - middle[:, None]) * present) ** 2).sum(axis=1) / size)
    spread = np.maximum(spread, 1e-6)
    t = (x - middle[:, None]) / spread[:, None]
    level, slope, deviation, found = _fit_edges(t, bottom, present, unit)
    _, lean, other, crowned = _fit_edges(t, top, present, unit)
    agree = crowned & (np.abs(lean - slope) < 4 * np.hypot(deviation, other))
    slope = np.where(agree, 0.5 * (slope + lean), slope)
    deviation = np.where(agree, 0.5 * np.hypot(deviation, other), deviation)
    begin = np.where(present, left, np.inf).min(axis=1)
    end = np.where(present, right, -np.inf).max(axis=1)
    at = (np.stack([begin, end], axis=1) - middle[:, None]) / spread[:, None]
    y = level[:, None] + slope[:, None] * at
    reach = np.abs(at).max(axis=1)
    return np.stack([begin, y[:, 0], end, y[:, 1], unit, deviation * np.hypot(1.0, reach)], axis=1)[found]


def _fit_edges(t: Floats, y: Floats, present: Mask, unit: Vector) -> tuple[Vector, Vector, Vector, Mask]:
    """Level, slope, their deviation, and whether there is one (L,): lines that most points (t, y) of a row lie on.

    Rows (L, N) are filled with points that are not `present`; `t` has unit spread in each.
    """
    origin = (y * present).sum(axis=1) / present.sum(axis=1)
    y = y - origin[:, None]
    level, slope = _weighted_lines(t, y, present.astype(np.float64))
    for k in range(EDGE_ROUNDS):
        scale = np.maximum(0.35 * 0.6**k, BASELINE_SCALE) * unit
        rest = y - level[:, None] - slope[:, None] * t
        level, slope = _weighted_lines(t, y, present * geman_mcclure_weights(rest, scale[:, None]))
    rest = y - level[:, None] - slope[:, None] * t
    near = present & (np.abs(rest) < 3 * BASELINE_SCALE * unit[:, None])
    count = near.sum(axis=1)
    found = count >= np.maximum(0.4 * present.sum(axis=1), 4)
    rms = np.sqrt((near * rest**2).sum(axis=1) / np.maximum(count, 1))
    return level + origin, slope, np.maximum(rms, 0.25) / np.sqrt(np.maximum(count, 1)), found


def _weighted_lines(t: Floats, y: Floats, weights: Floats) -> tuple[Vector, Vector]:
    """Level and slope (L,) of the least squares line of each row (L, N)."""
    w, wt = weights.sum(axis=1), (weights * t).sum(axis=1)
    wy, wty = (weights * y).sum(axis=1), (weights * t * y).sum(axis=1)
    # One character may keep all the weight, and then shows no slope.
    wtt = (weights * t * t).sum(axis=1) + LEAST_SLOPE_WEIGHT
    determinant = np.maximum(w * wtt - wt * wt, 1e-300)
    return (wtt * wy - wt * wty) / determinant, (w * wty - wt * wy) / determinant


def group_paragraphs(lines: Baselines, tolerance: float = 0.12, min_lines: int = 3) -> list[Paragraph]:
    """Runs of lines at a constant spacing, one below the other.

    The next line of a run overlaps the last in x, is of like height, and lies the run's spacing (within
    `tolerance`) below; a blank line ends the run.
    """
    if len(lines) == 0:
        return []
    y = 0.5 * (lines.starts[:, 1] + lines.ends[:, 1])
    left, right = lines.starts[:, 0], lines.ends[:, 0]
    following = np.full(len(y), -1)
    gap = np.full(len(y), np.inf)
    for i in range(len(y)):
        overlap = np.minimum(right, right[i]) - np.maximum(left, left[i])
        shorter = np.minimum(right - left, right[i] - left[i])
        below = (y > y[i] + 0.8 * lines.heights[i]) & (overlap > 0.5 * shorter)
        if below.any():
            j = int(np.argmin(np.where(below, y, np.inf)))
            ratio = lines.heights[j] / lines.heights[i]
            if 0.75 < ratio < 1.33:
                following[i], gap[i] = j, y[j] - y[i]
    paragraphs, used = [], np.zeros(len(y), bool)
    for i in range(len(y)):
        if used[i]:
            continue
        run, spacing, current = [i], 0.0, i
        while following[current] >= 0 and not used[following[current]]:
            step = gap[current]
            if spacing and abs(step - spacing) > tolerance * spacing:
                break
            spacing = step if not spacing else 0.7 * spacing + 0.3 * step
            current = int(following[current])
            run.append(current)
        if len(run) >= min_lines:
            used[run[:-1]] = True
            members = np.array(run)
            paragraphs.append(Paragraph(members, np.arange(len(run))))
    return paragraphs


def find_margins(
    lines: Baselines, side: str, width: float = 1.0, min_lines: int = 5
) -> list[NDArray[np.intp]]:
    """Groups of line numbers whose left (or right) ends are flush: the fullest windows of `width` text heights."""
    if len(lines) == 0:
        return []
    x = lines.starts[:, 0] if side == "left" else lines.ends[:, 0]
    reach = width * float(np.median(lines.heights))
    groups, free = [], np.argsort(x)
    while len(free) >= min_lines:
        count = np.searchsorted(x[free], x[free] + reach, side="right") - np.arange(len(free))
        first = int(np.argmax(count))
        if count[first] < min_lines:
            break
        groups.append(free[first : first + count[first]])
        free = np.delete(free, np.arange(first, first + count[first]))
    return groups


def group_alike(values: Vector) -> list[NDArray[np.intp]]:
    """Groups of at least two numbers of values that differ from the group's least by `ALIKE` at most."""
    groups, order, start = [], np.argsort(values), 0
    for k in range(1, len(order) + 1):
        if k == len(order) or values[order[k]] > (1 + ALIKE) * values[order[start]]:
            if k - start >= 2:
                groups.append(order[start:k])
            start = k
    return groups
