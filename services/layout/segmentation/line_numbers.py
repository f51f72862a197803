"""Line numbers in the left margin of manuscripts, pleadings and poems: a column of its own beside the text."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.segmentation.components import Indices
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.page_numbers import NUMBER_DIGITS
from services.layout.segmentation.text_lines import CAPITAL_HEIGHT, Line, measure_line

_LEAST_NUMBER_GAP = 0.9
"""Line numbers are at least this far from their lines."""
_NUMBER_EDGE_PX = 3.0
"""Numbers of one column have a common edge, in pixels of the working copy."""
_LEAST_NUMBERS = 8
"""A column has at least so many."""


@dataclass(frozen=True, slots=True, eq=False)
class _Head:
    """What may be the number of line `index`: its components, ends, middle row, and what is left of the line."""

    index: int
    members: Indices
    x0: float
    x1: float
    middle: float
    rest: Indices


def split_line_numbers(lines: Sequence[Line], components: InkComponents) -> tuple[list[Line], list[Line]]:
    """`lines` without the numbers before them, and those numbers from the top down; none without a column of them.

    Numbers are words of few digits, alone or smaller than their line, with one edge in common. They count every line,
    every fifth or every tenth: so marks of lists, which entries of several lines have, are none.
    """
    heads = [head for number, line in enumerate(lines) if (head := _find_head(number, line, components))]
    heads = _in_one_column(heads)
    if len(heads) < _LEAST_NUMBERS:
        return list(lines), []
    number_of = {head.index: head for head in heads}
    kept: list[Line] = []
    for index, line in enumerate(lines):
        head = number_of.get(index)
        if head is None:
            kept.append(line)
        elif len(head.rest):
            kept.append(measure_line(components, head.rest))
    if not _counts_rows(heads, kept):
        return list(lines), []
    return kept, [measure_line(components, head.members) for head in heads]


def _find_head(index: int, line: Line, components: InkComponents) -> _Head | None:
    """The word of few digits that a line begins with or is; None without."""
    if len(line.members) == 1:
        return _lone_head(index, line)
    members = line.members[np.argsort(components.boxes[line.members, 0], kind="stable")]
    boxes = components.boxes[members]
    gaps = boxes[1:, 0] - np.maximum.accumulate(boxes[:, 2])[:-1]
    digits = NUMBER_DIGITS
    wide = np.flatnonzero(gaps[:digits] > _LEAST_NUMBER_GAP * line.em)
    if len(wide):
        own = slice(0, int(wide[0]) + 1)
    elif len(members) <= digits and line.width < 0.8 * digits * line.em:
        own = slice(0, len(members))
    else:
        return None
    height = boxes[own, 3] - boxes[own, 1]
    rest = members[own.stop :]
    if np.ptp(height) > max(2.0, 0.2 * float(np.max(height))):
        return None
    if len(rest):
        capitals = CAPITAL_HEIGHT * measure_line(components, rest).em
        if float(np.max(height)) >= 0.85 * capitals:
            return None
    x0, x1 = float(np.min(boxes[own, 0])), float(np.max(boxes[own, 2]))
    middle = float(np.min(boxes[own, 1]) + np.max(boxes[own, 3])) / 2
    return _Head(index, np.asarray(members[own]), x0, x1, middle, np.asarray(rest))


def _lone_head(index: int, line: Line) -> _Head | None:
    """A line of one component, as dirty pages have many."""
    if line.width >= 0.8 * NUMBER_DIGITS * line.em:
        return None
    return _Head(index, line.members, line.box[0], line.box[2], _middle(line.box), line.members[:0])


def _in_one_column(heads: list[_Head]) -> list[_Head]:
    """The most heads that have an edge in common, from the top down."""
    best: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
    reach = _NUMBER_EDGE_PX
    for edge in (np.array([head.x1 for head in heads]), np.array([head.x0 for head in heads])):
        ordered = np.sort(edge)
        counts = np.searchsorted(ordered, edge + reach) - np.searchsorted(ordered, edge - reach, side="right")
        if counts.max(initial=0) > len(best):
            best = np.flatnonzero(np.abs(edge - edge[np.argmax(counts)]) < reach)
    return sorted((heads[index] for index in best), key=lambda head: head.middle)


def _counts_rows(heads: Sequence[_Head], texts: Sequence[Line]) -> bool:
    """Whether every row of `texts`, every fifth or every tenth has a number, and no text is in their column."""
    right = max(head.x1 for head in heads)
    top, bottom = heads[0].middle, heads[-1].middle
    beside = [line for line in texts if top - line.em < _middle(line.box) < bottom + line.em]
    beside = [line for line in beside if line.box[2] > right]
    if not beside or sum(line.box[0] < right for line in beside) > 0.1 * len(beside):
        return False
    em = float(np.median([line.em for line in beside]))
    middles = np.sort([_middle(line.box) for line in beside])
    rows = middles[np.diff(middles, prepend=-np.inf) > 0.5 * em]
    numbered = np.argmin(np.abs(rows[None, :] - np.array([head.middle for head in heads])[:, None]), axis=1)
    steps = np.diff(numbered)
    return float(np.median(steps)) in (1.0, 5.0, 10.0)


def _middle(box: Sequence[float]) -> float:
    return (box[1] + box[3]) / 2
