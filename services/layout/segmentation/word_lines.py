"""Lines of print from the words that were read, where the components of the ink do not show them.

Print of dots, and print that runs into a dark border, falls apart or together; a reader that looks at the picture
reads it all the same. Then its words make the rows, and these the lines, by the links and gutters of the words of
components.
"""

from collections.abc import Sequence

import numpy as np

from services.geometry.linked_groups import group_linked
from services.layout.segmentation.components import Boxes, Indices, members_of
from services.layout.segmentation.frame import PrintedPage
from services.layout.segmentation.gutters import split_at_gutters
from services.layout.segmentation.operators import find_operators
from services.layout.segmentation.text_lines import CAPITAL_HEIGHT, Line, row_links
from services.ocr.engine import MADE_UP, Word
from services.order_statistics import median

_USUAL_STROKE = 0.1
"""Stroke width over em, where no ink tells it."""


def lines_of_words(words: Sequence[Word], printed: PrintedPage) -> list[Line]:
    """Lines of the words, with the components in them; boxes are those of the words, levelled.

    Words that are no words for sure (`MADE_UP`) make none.
    """
    read = [word for word in words if word.confidence >= MADE_UP and any(map(str.isalnum, word.text))]
    if not read:
        return []
    frame, components = printed.frame, printed.levelled
    boxes = frame.level(np.array([word.box for word in read]) / np.array([*frame.scale, *frame.scale]))
    rows = group_linked(len(boxes), *row_links(boxes))
    operators = find_operators(components, np.flatnonzero(printed.kinds.glyphs))
    pieces = split_at_gutters(boxes, rows, (boxes, rows), operators)
    return [_line(boxes[own], printed) for own in members_of(pieces)]


def _line(boxes: Boxes, printed: PrintedPage) -> Line:
    """A line of words, as high as its capitals."""
    x0, y0 = boxes[:, :2].min(axis=0).tolist()
    x1, y1 = boxes[:, 2:].max(axis=0).tolist()
    height = max(median(boxes[:, 3] - boxes[:, 1]), 1.0)
    members = _inside(boxes, printed)
    ink = printed.levelled
    area = ink.area[members].sum()
    em = height / CAPITAL_HEIGHT
    stroke = float(ink.stroke[members] @ ink.area[members] / area) if area else _USUAL_STROKE * em
    return Line(members, (x0, y0, x1, y1), median(boxes[:, 3]), em, CAPITAL_HEIGHT * height, stroke)


def _inside(boxes: Boxes, printed: PrintedPage) -> Indices:
    """Components, but for rules and large ink, whose centres lie in one of the boxes."""
    own = printed.levelled.boxes
    x, y = (own[:, 0] + own[:, 2]) / 2, (own[:, 1] + own[:, 3]) / 2
    inside = (x[:, None] >= boxes[:, 0]) & (x[:, None] <= boxes[:, 2])
    inside &= (y[:, None] >= boxes[:, 1]) & (y[:, None] <= boxes[:, 3])
    small = ~(printed.kinds.rules | printed.kinds.large)
    return np.flatnonzero(inside.any(axis=1) & small)
