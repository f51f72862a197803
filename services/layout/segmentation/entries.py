"""Entries of lists like a memo's head: a short label ("TO:") and its value some way to the right are one line."""

import re
from collections.abc import Sequence

import numpy as np

from services.layout.segmentation.components import Boxes
from services.layout.segmentation.text_lines import Line
from services.layout.segmentation.typical_print import UNRELIABLE_STEP, WIDEST_VALUE

WIDEST_LABEL = 9.0
"""Labels of entries ("FROM:", "Phone number:") are shorter."""
_ENTRY_GAP = 4.5
"""Values begin at most this far behind the longest label."""
_ENTRY_TAB = 9.0
"""The same where the labels have colons: an inch in print of 8 points."""
_LINES_PER_ENTRY = 4.0
"""Largest mean number of lines of the values: a memo may have many receivers."""


_LABEL = re.compile(r"\W*(?:[^\W\d_]+\W{1,2}){0,2}[^\W\d_]+ ?: *\S")
"""A line of a label of at most three words and its value."""


def find_entries(lines: Sequence[Line], texts: Sequence[str]) -> tuple[list[tuple[int, int]], set[int]]:
    """Pairs (label, value) of indices of `lines`: at least two, one below the other, whose edges are even.

    Beside them the lines of the same lists that are entries as they are.

    The values begin little to the right of the longest label; columns of print lie farther apart, or are wider. Where
    most labels were read with a colon (`texts`) the values may be a tab stop away, and have more lines; a lone one is
    an entry next to entries whose values are so near that they are in one line with their labels.
    """
    if len(lines) < 4:
        return [], set()
    boxes: Boxes = np.array([line.box for line in lines])
    baseline = np.array([line.baseline for line in lines])
    em = np.array([line.em for line in lines])
    x0, x1 = boxes[:, 0], boxes[:, 2]
    level = np.abs(baseline[:, None] - baseline) < 0.35 * em[:, None]
    alike = np.abs(np.log(em[:, None] / em)) < np.log(UNRELIABLE_STEP)
    gap = np.where(level & alike, x0[None, :] - x1[:, None], np.inf)
    gap = np.where(gap > 0, gap, np.inf)
    value = np.argmin(gap, axis=1)
    nearest = gap[np.arange(len(lines)), value]
    labels = np.flatnonzero((x1 - x0 < WIDEST_LABEL * em) & (nearest < (WIDEST_LABEL + _ENTRY_TAB) * em))
    colon = np.array([text.rstrip().endswith(":") for text in texts], dtype=bool)
    has_label = np.array([_LABEL.match(text) is not None for text in texts], dtype=bool)
    pairs: list[tuple[int, int]] = []
    entries: set[int] = set()
    for label in labels:
        slack = 0.5 * em[label]
        of_list = np.abs(x0[labels] - x0[label]) < slack
        of_list &= np.abs(x0[value[labels]] - x0[value[label]]) < slack
        others = labels[of_list]
        whole = has_label & (np.abs(x0 - x0[label]) < slack)
        if len(others) < 2 and not (colon[label] and np.any(whole)):
            continue
        entry_gap = _ENTRY_TAB if np.mean(colon[others]) > 0.5 else _ENTRY_GAP
        # The text next to notes in a margin has many more lines.
        between = (baseline > np.min(baseline[others]) - em[label]) & (
            baseline < np.max(baseline[others]) + em[label]
        )
        column = between & (np.abs(x0 - x0[value[label]]) < slack)
        if np.count_nonzero(column) > _LINES_PER_ENTRY * len(others):
            continue
        if np.median((x1 - x0)[value[others]]) > WIDEST_VALUE * em[label]:
            continue
        if x0[value[label]] - np.max(x1[others]) < entry_gap * em[label]:
            pairs.append((int(label), int(value[label])))
            entries.update(np.flatnonzero(whole).tolist())
    return _apart(sorted(pairs, key=lambda pair: x0[pair[0]])), entries


def _apart(pairs: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """The pairs, from left to right, without those whose label is the value of one before: a row of a table."""
    kept: list[tuple[int, int]] = []
    values: set[int] = set()
    for label, value in pairs:
        if label not in values:
            kept.append((label, value))
            values.add(value)
    return kept
