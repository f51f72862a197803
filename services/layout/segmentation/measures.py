"""Measures of a zone from its lines: font size, line spacing, weight, alignment."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from services.layout.page import Alignment
from services.layout.segmentation.text_lines import Line

SAME_ROW = 0.3
"""Baselines that are nearer, in ems, are those of one row."""


def zone_font_size(lines: Sequence[Line]) -> float:
    """Em of a zone in pixels of the working copy: the median of its lines', by their width."""
    return _weighted_median([line.em for line in lines], [line.width for line in lines])


def zone_line_spacing(lines: Sequence[Line]) -> float | None:
    """Median distance of the baselines of rows in pixels of the working copy; None for one row."""
    steps = _row_steps(lines)
    return float(np.median(steps)) if len(steps) else None


def count_rows(lines: Sequence[Line]) -> int:
    """Rows of print: lines side by side, as in a zone that was put together, are one."""
    return len(_row_steps(lines)) + 1


def rows_of_lines(lines: Sequence[Line], left: Sequence[float]) -> list[list[int]]:
    """Places of `lines`, whose left ends are `left`, by rows from the top, from left to right within a row."""
    downwards = sorted(range(len(lines)), key=lambda place: lines[place].baseline)
    rows = [downwards[:1]] if downwards else []
    least = _least_step(lines) if lines else 0.0
    for above, place in pairwise(downwards):
        if lines[place].baseline - lines[above].baseline > least:
            rows.append([])
        rows[-1].append(place)
    return [sorted(row, key=lambda place: left[place]) for row in rows]


def order_by_rows(lines: Sequence[Line], left: Sequence[float]) -> list[int]:
    """Places of `lines`, whose left ends are `left`, row by row."""
    return [place for row in rows_of_lines(lines, left) for place in row]


def _row_steps(lines: Sequence[Line]) -> NDArray[np.float64]:
    steps = np.diff(sorted(line.baseline for line in lines))
    return np.asarray(steps[steps > _least_step(lines)])


def _least_step(lines: Sequence[Line]) -> float:
    """Least distance of the baselines of two rows, pixels of the working copy."""
    return SAME_ROW * min(line.em for line in lines)


def zone_weight(lines: Sequence[Line]) -> float:
    """Stroke width over font size."""
    return _weighted_median([line.stroke / line.em for line in lines], [line.width for line in lines])


def _weighted_median(values: Sequence[float], weights: Sequence[float]) -> float:
    order = np.argsort(values)
    total = np.cumsum(np.array(weights)[order])
    return float(np.array(values)[order][np.searchsorted(total, total[-1] / 2)])


def zone_alignment(
    lines: Sequence[Line], column: tuple[float, float], em: float, indent: float = 9.0
) -> Alignment | None:
    """Alignment of lines, from their edges and centres, or for a single line from its place in its `column` (x0, x1).

    None for a single line that fills its column.
    """
    left = np.array([line.box[0] for line in lines])
    right = np.array([line.box[2] for line in lines])
    slack = 0.6 * em
    if len(lines) == 1:
        return _lone_alignment(left[0] - column[0], column[1] - right[0], slack)
    # First lines are indented, last lines end early.
    later = left[1:] if abs(left[0] - left[1]) < indent * em else left
    left_even, right_even = np.ptp(later) < 2 * slack, np.ptp(right[:-1]) < 2 * slack
    if len(lines) > 2 and left_even and right_even:
        return "justified"
    spread = {
        "left": float(np.std(left) if len(lines) == 2 else np.std(later)),
        "right": float(np.std(right)),
        "centre": float(np.std((left + right) / 2)),
    }
    if len(lines) == 2 and left_even and max(right) - min(right) < 2 * slack:
        return "justified"
    names: tuple[Alignment, ...] = ("left", "right", "centre")
    return min(names, key=lambda name: spread[name])


def _lone_alignment(before: float, behind: float, slack: float) -> Alignment | None:
    if before < slack:
        return None if behind < slack else "left"
    if behind < slack:
        return "right"
    return "centre" if abs(before - behind) < max(2 * slack, 0.1 * (before + behind)) else "left"
