"""Text lines of a page from its components: glyphs to words, words to lines, lines split at gutters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.geometry.linked_groups import group_linked
from services.layout.segmentation.components import Boxes, Indices, members_of, near_pairs
from services.layout.segmentation.gutters import WIDEST_GAP, split_at_gutters
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.operators import TALLEST_PARTNER, find_operators, links_across
from services.order_statistics import higher_quantile, mean, median, quantile

_MOST_LINES = 1500
"""Of a page with more the widest are taken; a page of small print has 200."""
_LETTER_GAP = 0.6
"""Components nearer than this times their height are one word, or words near each other."""
_MARK_GAP = 2.2
"""Largest distance of a list's mark from its line, including the width of the mark."""
_END_GAP = 0.9
"""Largest distance of a full stop, a superscript or a closing sign from its line."""
CAPITAL_HEIGHT = 0.70
"""Height of capitals and ascenders over em: Times 0.67, Computer Modern 0.69, Helvetica 0.72."""
RELIABLE_COMPONENTS = 5
"""Of fewer letters a slant is chance, and a size or weight is sure only where it differs much."""


_LONG = 4
"""Lines with this many components are not fragments of others."""
_TOGETHER = 256
"""Fragments that are compared with all longer lines at a time, which bounds the memory."""


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One line of print, in pixels of the levelled working copy.

    `members` are indices of its components; `em` its font size by its capitals and ascenders, `small` the
    height of its letters without (of capitals, where there are no others); `stroke` its mean stroke width;
    `slant` the median one of its letters, None where there are too few.
    """

    members: Indices
    box: tuple[float, float, float, float]
    baseline: float
    em: float
    small: float
    stroke: float
    slant: float | None = None

    @property
    def width(self) -> float:
        return self.box[2] - self.box[0]

    @property
    def height(self) -> float:
        return self.box[3] - self.box[1]


def find_lines(components: InkComponents, glyphs: Indices) -> list[Line]:
    """Candidate lines of the components `glyphs`, whose boxes are levelled; some may not be text."""
    if len(glyphs) == 0:
        return []
    glyphs = _without_bridges(components, glyphs)
    boxes = components.boxes[glyphs]
    words = group_linked(len(glyphs), *_word_links(boxes))
    word_boxes = unite_boxes(boxes, words)
    operators = find_operators(components, glyphs)
    links = row_links(word_boxes), links_across(operators, word_boxes)
    rows = group_linked(len(word_boxes), *np.concatenate(links, axis=1))
    if rows.max() >= _MOST_LINES:
        rows = _widest(word_boxes, rows, _MOST_LINES)
    pieces = split_at_gutters(word_boxes, rows, (boxes, rows[words]), operators)
    return _join_fragments([glyphs[members] for members in members_of(pieces[words])], components)


def _join_fragments(pieces: list[Indices], components: InkComponents) -> list[Line]:
    """Lines of `pieces`, short ones joined to a longer one that they lie in, end, or begin as a list's mark does."""
    lines = [measure_line(components, members) for members in pieces]
    boxes = np.array([line.box for line in lines])
    counts = np.array([len(members) for members in pieces])
    long = np.flatnonzero(counts >= _LONG)
    em = np.array([lines[index].em for index in long])
    reach = np.column_stack([-_MARK_GAP * em, 0.0 * em, _END_GAP * em, 0.0 * em])
    wide = boxes[long] + reach
    joined: dict[int, list[Indices]] = {}
    kept = np.ones(len(lines), dtype=bool)
    short = np.flatnonzero(counts < _LONG)
    for some in (short[at : at + _TOGETHER] for at in range(0, len(short) if len(long) else 0, _TOGETHER)):
        x0, y0, x1, y1 = boxes[some].T[:, :, None]
        across = np.minimum(wide[:, 2], x1) - np.maximum(wide[:, 0], x0)
        down = np.minimum(wide[:, 3], y1) - np.maximum(wide[:, 1], y0)
        within = (across > 0.5 * (x1 - x0)) & (down > 0.5 * (y1 - y0)) & (y1 - y0 < 1.4 * em)
        # A mark at the left is narrow; a word there is not the line's.
        within &= (x0 >= boxes[long, 0]) | (x1 - x0 < 1.2 * em)
        within &= counts[long] > 2 * counts[some, None]
        targets = long[np.argmax(np.where(within, down * across, -1.0), axis=1)]
        for place in np.flatnonzero(within.any(axis=1)).tolist():
            joined.setdefault(int(targets[place]), []).append(pieces[some[place]])
            kept[some[place]] = False
    for target, more in joined.items():
        members = np.concatenate([pieces[target], *more])
        lines[target] = measure_line(components, members)
    return [line for line, keep in zip(lines, kept, strict=True) if keep]


def measure_line(components: InkComponents, members: Indices) -> Line:
    """A line of the components `members`: baseline, em from the height of capitals and ascenders, strokes."""
    if len(members) == 1:
        return _measure_glyph(components, members)
    boxes = components.boxes[members]
    x0, y0 = boxes[:, :2].min(axis=0).tolist()
    x1, y1 = boxes[:, 2:].max(axis=0).tolist()
    height = boxes[:, 3] - boxes[:, 1]
    tall = height > 0.5 * median(height)
    # Of the feet, descenders are the lower tenth to third (in words whose letters touch).
    centre = (boxes[:, 0] + boxes[:, 2]) / 2
    feet = boxes[:, 3] - components.hang[members]
    slope = _line_slope(centre[tall], feet[tall])
    foot = feet - slope * (centre - mean(centre))
    reach = 0.15 * median(height[tall])
    baseline = _near_mean(foot[tall], quantile(foot[tall], 0.4), reach)
    rise = (baseline - foot + height - components.hang[members])[tall & (np.abs(foot - baseline) < 2 * reach)]
    if len(rise) == 0:
        rise = height
    capitals = higher_quantile(rise, 0.88)
    # Heights are whole pixels; the mean of many is finer.
    capitals = _near_mean(rise, capitals, 0.12 * capitals)
    area = components.area[members]
    stroke = float((components.stroke[members] * area).sum() / area.sum())
    em = max(capitals, 1.0) / CAPITAL_HEIGHT
    small = quantile(rise, 0.4)
    # Words whose letters touch have no slant of their own.
    letters = tall & (boxes[:, 2] - boxes[:, 0] < 1.2 * height)
    slants = components.slant[members[letters]]
    slant = median(slants) if len(slants) >= RELIABLE_COMPONENTS else None
    return Line(members, (x0, y0, x1, y1), baseline, em, small, stroke, slant)


def _measure_glyph(components: InkComponents, members: Indices) -> Line:
    """`measure_line` of one component; dirty pages have hundreds."""
    glyph = int(members[0])
    x0, y0, x1, y1 = components.boxes[glyph].tolist()
    hang, area = float(components.hang[glyph]), components.area[glyph]
    rise = (y1 - y0) - hang
    em = max(rise, 1.0) / CAPITAL_HEIGHT
    return Line(members, (x0, y0, x1, y1), y1 - hang, em, rise, float(components.stroke[glyph] * area / area))


def _near_mean(values: NDArray[np.float64], centre: float, reach: float) -> float:
    """Mean of the values within `reach` of `centre`; `centre` where there are none."""
    near = values[np.abs(values - centre) <= reach]
    return mean(near) if len(near) else centre


def _line_slope(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """What is left of a line's slope after the page was levelled; 0 for short lines."""
    if len(x) < 12:
        return 0.0
    third = len(x) // 3
    order = np.argsort(x)
    left, right = order[:third], order[-third:]
    run = median(x[right]) - median(x[left])
    rise = quantile(y[right], 0.4) - quantile(y[left], 0.4)
    return min(max(rise / max(run, 1.0), -0.02), 0.02)


def unite_boxes(boxes: Boxes, groups: Indices) -> Boxes:
    """Box round every group's boxes; `groups` (N,) number them from 0 without a gap."""
    count = int(groups.max()) + 1
    united = np.empty((count, 4))
    united[:, :2], united[:, 2:] = np.inf, -np.inf
    for column in (0, 1):
        np.minimum.at(united[:, column], groups, boxes[:, column])
        np.maximum.at(united[:, column + 2], groups, boxes[:, column + 2])
    return united


def _side_by_side(boxes: Boxes) -> tuple[Indices, Indices, NDArray[np.float64], NDArray[np.float64]]:
    """Pairs whose rows overlap: left one, right one, gap between them in x, shared rows over the lower's height."""
    x0, y0, x1, y1 = np.ascontiguousarray(boxes.T)
    i, j = near_pairs(y0, y1)
    middle, height = x0 + x1, y1 - y0
    swap = middle[i] > middle[j]
    i, j = np.where(swap, j, i), np.where(swap, i, j)
    shared = np.minimum(y1[i], y1[j]) - np.maximum(y0[i], y0[j])
    return i, j, x0[j] - x1[i], shared / np.maximum(np.minimum(height[i], height[j]), 1e-9)


def _without_bridges(components: InkComponents, glyphs: Indices) -> Indices:
    """`glyphs` without components that join two lines: those have small neighbours at two levels."""
    boxes = components.boxes[glyphs]
    height = boxes[:, 3] - boxes[:, 1]
    i, j, gap, shared = _side_by_side(boxes)
    tall, small = np.where(height[i] > height[j], i, j), np.where(height[i] > height[j], j, i)
    beside = (height[tall] > 2.0 * height[small]) & (gap < 0.7 * height[tall]) & (shared > 0.7)
    tall, small = tall[beside], small[beside]
    foot = boxes[small, 3]
    lowest, highest = np.full(len(glyphs), -np.inf), np.full(len(glyphs), np.inf)
    np.maximum.at(lowest, tall, foot)
    np.minimum.at(highest, tall, foot)
    typical = np.zeros(len(glyphs))
    np.maximum.at(typical, tall, height[small])
    bridges = lowest - highest > 1.1 * np.maximum(typical, 0.3 * height)
    return np.asarray(glyphs[~bridges], dtype=np.intp)


def _word_links(boxes: Boxes) -> tuple[Indices, Indices]:
    i, j, gap, shared = _side_by_side(boxes)
    height = boxes[:, 3] - boxes[:, 1]
    larger, lower = np.maximum(height[i], height[j]), np.minimum(height[i], height[j])
    linked = (gap < _LETTER_GAP * larger) & (shared > 0.5)
    linked &= larger < TALLEST_PARTNER * lower
    return i[linked], j[linked]


def row_links(boxes: Boxes) -> tuple[Indices, Indices]:
    """Links of words to the next word of their row; of two columns, too, where the gutter is narrow."""
    i, j, gap, shared = _side_by_side(boxes)
    height = boxes[:, 3] - boxes[:, 1]
    larger, lower = np.maximum(height[i], height[j]), np.minimum(height[i], height[j])
    # A word's box is 0.45 to 0.95 em high.
    linked = (gap < WIDEST_GAP * np.minimum(larger, 1.6 * lower) / 0.8) & (shared > 0.55)
    linked &= larger < TALLEST_PARTNER * lower
    return i[linked], j[linked]


def _widest(boxes: Boxes, rows: Indices, most: int) -> Indices:
    """`rows` renumbered with the `most` widest; all others are -1."""
    united = unite_boxes(boxes, rows)
    kept = np.argsort(united[:, 0] - united[:, 2], kind="stable")[:most]
    numbers = np.full(len(united), -1)
    numbers[kept] = np.arange(len(kept))
    return np.asarray(numbers[rows], dtype=np.intp)
