"""Entries of lists like a memo's head: a short label ("TO:") and its value some way to the right are one line."""

from collections.abc import Sequence

import numpy as np

from services.layout.segmentation.components import Boxes
from services.layout.segmentation.parameters import SegmentationParameters
from services.layout.segmentation.text_lines import Line


def find_entries(lines: Sequence[Line], parameters: SegmentationParameters) -> list[tuple[int, int]]:
    """Pairs (label, value) of indices of `lines`: at least two, one below the other, whose edges are even.

    The values begin little to the right of the longest label; columns of print lie farther apart, or are wider.
    """
    if len(lines) < 4:
        return []
    boxes: Boxes = np.array([line.box for line in lines])
    baseline = np.array([line.baseline for line in lines])
    em = np.array([line.em for line in lines])
    x0, x1 = boxes[:, 0], boxes[:, 2]
    level = np.abs(baseline[:, None] - baseline) < 0.35 * em[:, None]
    alike = np.abs(np.log(em[:, None] / em)) < np.log(parameters.unreliable_step)
    gap = np.where(level & alike, x0[None, :] - x1[:, None], np.inf)
    gap = np.where(gap > 0, gap, np.inf)
    value = np.argmin(gap, axis=1)
    nearest = gap[np.arange(len(lines)), value]
    labels = np.flatnonzero(
        (x1 - x0 < parameters.widest_label * em)
        & (nearest < (parameters.widest_label + parameters.entry_gap) * em)
    )
    pairs: list[tuple[int, int]] = []
    for label in labels:
        slack = 0.5 * em[label]
        of_list = np.abs(x0[labels] - x0[label]) < slack
        of_list &= np.abs(x0[value[labels]] - x0[value[label]]) < slack
        of_list &= np.abs(baseline[labels] - baseline[label]) < parameters.list_reach * em[label]
        others = labels[of_list]
        if len(others) < 2:
            continue
        # The text next to notes in a margin has many more lines.
        between = (baseline > np.min(baseline[others]) - em[label]) & (
            baseline < np.max(baseline[others]) + em[label]
        )
        column = between & (np.abs(x0 - x0[value[label]]) < slack)
        if np.count_nonzero(column) > parameters.lines_per_entry * len(others):
            continue
        if np.median((x1 - x0)[value[others]]) > parameters.widest_value * em[label]:
            continue
        if x0[value[label]] - np.max(x1[others]) < parameters.entry_gap * em[label]:
            pairs.append((int(label), int(value[label])))
    return pairs
