"""Gutters between columns: gaps in rows of words that continue in the rows around."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.segmentation.components import Boxes, Indices, members_of
from services.layout.segmentation.monospace import cell_widths
from services.layout.segmentation.typical_print import EDGE_SLACK, LEAST_SPACE, ROW_REACH
from services.order_statistics import median, quantile

WIDEST_GAP = 3.0
"""Wider gaps always end a line; three spaces of a typewriter are 2.3."""
_WIDE_GAP = 0.7
"""Narrower gaps never end a line: spaces of justified print are 0.2 to 0.7."""
_WORD_GAP = 1.6
"""A gap that fewer than two other rows share, and none crosses, ends a line from here on."""
_GAP_OVER_SPACE = 1.9
"""Least ratio of a gap that ends a line to the spaces between words around it."""
_GUTTER_OVER_SPACE = 1.1
"""The same where at least `_GUTTER_ROWS` rows around have the gap, and none crosses it."""
_GUTTER_ROWS = 4
_LEAST_BLANK_CELLS = 3.7
"""In monospaced print narrower gaps, of up to three blanks, are no gutters."""


@dataclass(frozen=True, slots=True, eq=False)
class _Gaps:
    """Wide gaps of all rows (G,): their row, edges, and the em of the row; the space left of a row is one, too."""

    row: Indices
    x0: NDArray[np.float64]
    x1: NDArray[np.float64]
    em: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Rows (R,): the middle of their height, their ends, and the space between words around, px."""

    middle: NDArray[np.float64]
    x0: NDArray[np.float64]
    x1: NDArray[np.float64]
    space: NDArray[np.float64]


def split_at_gutters(
    boxes: Boxes,
    rows: Indices,
    glyphs: tuple[Boxes, Indices],
    operators: Boxes,
) -> Indices:
    """Pieces (words,) of rows, split at gaps that are gutters; -1 for words of no row.

    Parameters
    ----------
    boxes, rows
        (words, 4), and the rows (words,) numbered from 0, -1 for none.
    glyphs
        The same two of the glyphs of all words.
    operators
        (M, 4); they lie in gaps, but make no rows.
    """
    members = members_of(rows)
    table, gaps = _measure(boxes, members, operators)
    cells = cell_widths(glyphs[0], members_of(glyphs[1]))
    cuts: dict[int, list[float]] = {}
    for index in np.flatnonzero(np.isfinite(gaps.x0)):
        if gaps.x1[index] - gaps.x0[index] < _LEAST_BLANK_CELLS * cells[gaps.row[index]]:
            continue
        if _is_gutter(int(index), gaps, table):
            cuts.setdefault(int(gaps.row[index]), []).append(float(gaps.x1[index]))
    pieces = np.full(len(rows), -1, dtype=np.intp)
    number = 0
    for row, words in enumerate(members):
        own = np.searchsorted(sorted(cuts.get(row, [])), boxes[words, 0], side="right")
        pieces[words] = number + own
        number += int(own.max()) + 1
    return pieces


def _measure(boxes: Boxes, members: Sequence[Indices], operators: Boxes) -> tuple[_Rows, _Gaps]:
    rows = np.zeros((len(members), 4))
    level = (operators[:, 1] + operators[:, 3]) / 2
    spaces: list[tuple[float, float]] = []
    gaps: list[tuple[float, float, float, float]] = []
    for row, words in enumerate(members):
        if len(words) == 1:
            # Dirty pages have hundreds of them.
            x0, y0, x1, y1 = boxes[words[0]].tolist()
            em = (y1 - y0) / 0.85
            rows[row] = (y0 + y1) / 2, x0, x1, em
            gaps.append((row, -np.inf, x0, em))
            continue
        own = boxes[words]
        # A word's box is 0.45 to 0.95 em high, 0.7 to 0.9 where it has ascenders.
        em = quantile(own[:, 3] - own[:, 1], 0.6) / 0.85
        # Broken letters are lower than a word; the row is 0.9 em high, but for capitals alone.
        x0, y0 = own[:, :2].min(axis=0).tolist()
        x1, y1 = own[:, 2:].max(axis=0).tolist()
        em = min(max((y1 - y0) / 0.9, em), 1.5 * em)
        rows[row] = (y0 + y1) / 2, x0, x1, em
        inside = (
            (level > y0 + 0.2 * (y1 - y0)) & (level < y1) & (operators[:, 0] > x0) & (operators[:, 2] < x1)
        )
        own = np.concatenate([own, operators[inside]])
        own = own[np.argsort(own[:, 0])]
        reach = np.maximum.accumulate(own[:, 2])
        gaps.append((row, -np.inf, float(own[0, 0]), em))
        width = own[1:, 0] - reach[:-1]
        spaces.extend((row, each) for each in width[width > LEAST_SPACE * em])
        for k in np.flatnonzero(width > _WIDE_GAP * em):
            gaps.append((row, float(reach[k]), float(own[k + 1, 0]), em))
    table = np.array(gaps)
    divided = np.unique(table[np.isfinite(table[:, 1]), 0]).astype(np.intp)
    rows[:, 3] = _typical_spaces(np.array(spaces).reshape(-1, 2), rows[:, 0], rows[:, 3], divided)
    return _Rows(*rows.T), _Gaps(table[:, 0].astype(np.intp), *table[:, 1:].T)


def _typical_spaces(
    spaces: NDArray[np.float64],
    middle: NDArray[np.float64],
    em: NDArray[np.float64],
    divided: Indices,
) -> NDArray[np.float64]:
    """Median space of the rows `divided` and those around each, px, 0 of others; of `spaces` (S, 2), row and width.

    No wider than what ends a line alone: the spaces of tight print are not counted, and then the gutters are most.
    """
    typical = np.zeros(len(middle))
    level = middle[spaces[:, 0].astype(np.intp)]
    for row in divided.tolist():
        near = spaces[np.abs(level - middle[row]) < ROW_REACH * em[row], 1]
        typical[row] = min(median(near), _WORD_GAP * em[row]) if len(near) else 0.0
    return typical


def _is_gutter(index: int, gaps: _Gaps, rows: _Rows) -> bool:
    """Whether a gap continues in the rows above and below, or is wide enough without that."""
    x0, x1, em = gaps.x0[index], gaps.x1[index], gaps.em[index]
    width = (x1 - x0) / em
    over_space = (x1 - x0) / max(rows.space[gaps.row[index]], 1e-9)
    if over_space < _GUTTER_OVER_SPACE:
        return False
    if width > WIDEST_GAP and over_space > _GAP_OVER_SPACE:
        return True
    distance = np.abs(rows.middle - rows.middle[gaps.row[index]])
    near = (distance < ROW_REACH * em) & (distance > 0.5 * em)
    crossing = near & (rows.x0 < x0) & (rows.x1 > x1)
    shared = np.minimum(gaps.x1, x1) - np.maximum(gaps.x0, x0)
    # The same channel of white, with print that begins on its right edge or ends on its left.
    same = near[gaps.row] & (shared > EDGE_SLACK * em)
    slack = EDGE_SLACK * em
    same &= (np.abs(gaps.x1 - x1) < slack) | (np.abs(gaps.x0 - x0) < slack) | (shared > 1.2 * em)
    same &= np.isfinite(gaps.x0) | (np.abs(gaps.x1 - x1) < slack)
    supporting = np.unique(gaps.row[same])
    supports = len(supporting)
    crossing[supporting] = False
    contras = int(np.count_nonzero(crossing))
    if over_space < _GAP_OVER_SPACE:
        # As wide as a space of justified print: a gutter only where all rows around have it.
        return supports >= _GUTTER_ROWS and contras == 0
    if supports >= 2:
        return supports > contras
    return width > _WORD_GAP and contras == 0
