"""Page numbers in the row of a running head or foot: they become lines of their own."""

from collections.abc import Sequence

import numpy as np

from services.layout.segmentation.components import Indices
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.text_lines import CAPITAL_HEIGHT, END_GAP, Line, measure_line
from services.layout.segmentation.typical_print import LEAST_SPACE

_RUNNING_MARGIN = 0.1
"""Largest distance of running heads and feet from the page's edge, over its height."""
_RUNNING_COMPONENTS = 10
"""Least number of their glyphs ..."""
NUMBER_DIGITS = 4
"""... and largest number of those of a page number,"""
_NUMBER_STEP = 1.1
"""which is higher than the capitals next to it by this factor,"""
_NUMBER_GAP = 2.5
"""or apart from them by this multiple of the spaces between words."""


def split_page_numbers(lines: Sequence[Line], components: InkComponents, page_height: float) -> list[Line]:
    """`lines` with the numbers at either end of those near the page's upper and lower edge as lines of their own.

    A number is a word of few glyphs of one height, which are higher than the capitals of the line, or far from it.
    `page_height` in pixels of the working copy.
    """
    margin = _RUNNING_MARGIN * page_height
    parts: list[Line] = []
    for line in lines:
        middle = (line.box[1] + line.box[3]) / 2
        number = None
        if min(middle, page_height - middle) < margin and len(line.members) >= _RUNNING_COMPONENTS:
            number = _find_number(line, components)
        if number is None:
            parts.append(line)
            continue
        rest = np.setdiff1d(line.members, number)
        parts.extend(measure_line(components, members) for members in (rest, number))
    return parts


def _find_number(line: Line, components: InkComponents) -> Indices | None:
    """Components of the number at the right or left end of a line; None without."""
    members = line.members[np.argsort(components.boxes[line.members, 0], kind="stable")]
    boxes = components.boxes[members]
    gaps = boxes[1:, 0] - np.maximum.accumulate(boxes[:, 2])[:-1]
    spaces = np.flatnonzero(gaps > LEAST_SPACE * line.em)
    if len(spaces) == 0:
        return None
    usual = float(np.median(gaps[spaces]))
    for space, own in ((spaces[-1], slice(spaces[-1] + 1, None)), (spaces[0], slice(0, spaces[0] + 1))):
        if not 0 < len(members[own]) <= NUMBER_DIGITS:
            continue
        height = boxes[own, 3] - boxes[own, 1]
        if np.ptp(height) > max(1.0, 0.1 * float(np.max(height))):
            continue
        if np.max(np.abs(boxes[own, 3] - line.baseline)) > 0.15 * line.em:
            continue
        rest = measure_line(components, np.delete(members, own))
        capitals = CAPITAL_HEIGHT * rest.em
        far = gaps[space] > _NUMBER_GAP * max(usual, LEAST_SPACE * line.em)
        far &= gaps[space] > END_GAP * line.em and float(np.min(height)) > 0.9 * capitals
        if far or float(np.min(height)) > _NUMBER_STEP * capitals:
            return np.asarray(members[own], dtype=np.intp)
    return None
