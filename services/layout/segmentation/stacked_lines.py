"""Lines that hold two rows of print are parted by their words.

What is no print but as high, the grain of a desk beside the paper or a mark at the height of two rows, links the
components of both to one line. A reader that looks at the picture reads two rows all the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from services.layout.page import Box
from services.layout.segmentation.components import Boxes, Indices
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.text_lines import Line, measure_line
from services.layout.word_rows import rows_of_words

_LETTERS = 3
"""Letters and digits of a row; a raised mark has fewer."""
_APART = 0.25
"""Largest common height of two rows, as a share of the lower one's."""
_TALLEST = 1.6
"""Height of a component of a row over that of its words: a higher one belongs to both rows."""
_REACH = 0.75
"""Distance of a component's middle from that of the nearest word of its row, in heights of the word."""


@dataclass(frozen=True, slots=True)
class ReadWord:
    """A word that was read for sure: its `box` on the levelled working copy, and its number of `letters`."""

    box: Box
    letters: int


def split_stacked(
    lines: Sequence[Line], words: Sequence[Sequence[ReadWord]], components: InkComponents
) -> list[Line]:
    """The lines; those whose `words` stand in rows above each other are one line for each row that has ink.

    Components that are in no row, or in two, are dropped from such a line.
    """
    found: list[Line] = []
    for line, own in zip(lines, words, strict=True):
        parts = [_members(row, line.members, components) for row in _stacked_rows(own)]
        split = [measure_line(components, part) for part in parts if len(part)]
        found += split or [line]
    return found


def _stacked_rows(words: Sequence[ReadWord]) -> list[Boxes]:
    """Boxes (W, 4) of the words by rows from the top, where each of the rows is below the one before; else none."""
    rows = rows_of_words(words) if len(words) > 1 else []
    boxes = [
        np.array([word.box for word in row]) for row in rows if sum(each.letters for each in row) >= _LETTERS
    ]
    if len(boxes) < 2 or not all(_is_below(lower, upper) for upper, lower in pairwise(boxes)):
        return []
    return boxes


def _is_below(lower: Boxes, upper: Boxes) -> bool:
    """Whether a row is below another one, over a part of its width."""
    (_, a, _, b), (_, c, _, d) = np.median(upper, axis=0), np.median(lower, axis=0)
    common = min(b, d) - max(a, c)
    across = min(upper[:, 2].max(), lower[:, 2].max()) - max(upper[:, 0].min(), lower[:, 0].min())
    return bool(common <= _APART * min(b - a, d - c) and across > 0)


def _members(row: Boxes, members: Indices, components: InkComponents) -> Indices:
    """The components among `members` that lie in a row of words."""
    boxes = components.boxes[members]
    x, y = (boxes[:, 0] + boxes[:, 2]) / 2, (boxes[:, 1] + boxes[:, 3]) / 2
    beside = np.maximum(row[:, 0] - x[:, None], x[:, None] - row[:, 2])
    near = row[np.argmin(beside, axis=1)]
    height = near[:, 3] - near[:, 1]
    is_in = np.abs(y - (near[:, 1] + near[:, 3]) / 2) < _REACH * height
    is_in &= boxes[:, 3] - boxes[:, 1] < _TALLEST * height
    is_in &= beside.min(axis=1) < height
    return np.asarray(members[is_in], dtype=np.intp)
