"""Operators and dashes: strokes too low for glyphs, which keep the words on both sides in one row."""

import numpy as np

from services.layout.segmentation.components import LEAST_GLYPH, Boxes, Indices
from services.layout.segmentation.ink import InkComponents
from services.order_statistics import median

TALLEST_PARTNER = 2.3
"""Largest ratio of the heights of linked components: x-height to brackets is 2.1."""
_OPERATOR_ASPECT = 1.5
"""Strokes of "=" and dashes are this elongated, ..."""
_OPERATOR_GAP = 2.0
"""... and stand no farther from the words on both sides, in ems."""
_MOST_OPERATORS = 1000
"""More are dirt."""


def find_operators(components: InkComponents, glyphs: Indices) -> Boxes:
    """Boxes (M, 4) of the strokes of "=", "-" and dashes, which are too low for glyphs."""
    boxes = components.boxes
    height, width = boxes[:, 3] - boxes[:, 1], boxes[:, 2] - boxes[:, 0]
    unit = median(height[glyphs])
    chosen = (height < LEAST_GLYPH * unit) & (width > _OPERATOR_ASPECT * height)
    chosen[glyphs] = False
    # Of more, which is dirt, none is an operator.
    return boxes[chosen] if np.count_nonzero(chosen) <= _MOST_OPERATORS else np.empty((0, 4))


def links_across(operators: Boxes, words: Boxes) -> tuple[Indices, Indices]:
    """Links (left, right) between the words next to an operator on both sides.

    `operators` (M, 4) and `words` (N, 4); words of very different heights are not linked.
    """
    height = words[:, 3] - words[:, 1]
    reach = _OPERATOR_GAP * height / 0.8
    left, right = [], []
    for x0, y0, x1, y1 in operators.tolist():
        level = (y0 + y1) / 2
        beside = (level > words[:, 1]) & (level < words[:, 3])
        before, after = x0 - words[:, 2], words[:, 0] - x1
        earlier = np.flatnonzero(beside & (before > 0) & (before < reach))
        later = np.flatnonzero(beside & (after > 0) & (after < reach))
        if len(earlier) and len(later):
            left.append(earlier[np.argmin(before[earlier])])
            right.append(later[np.argmin(after[later])])
    first, second = np.array(left, np.intp), np.array(right, np.intp)
    tallest = np.maximum(height[first], height[second])
    alike = tallest < TALLEST_PARTNER * np.minimum(height[first], height[second])
    return first[alike], second[alike]
