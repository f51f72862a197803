"""Page numbers in the row of a running head or foot: they become lines of their own."""

from collections.abc import Sequence

import numpy as np

from services.layout.segmentation.components import Indices
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.text_line_choice import LONG_LINE
from services.layout.segmentation.text_lines import CAPITAL_HEIGHT, Line, measure_line
from services.layout.segmentation.typical_print import LEAST_SPACE, SIZE_STEP

_RUNNING_MARGIN = 0.1
"""Largest distance of running heads and feet from the page's edge, over its height."""
NUMBER_DIGITS = 4
"""Largest number of glyphs of a page number, which are in a larger size than the others."""


def split_page_numbers(lines: Sequence[Line], components: InkComponents, page_height: float) -> list[Line]:
    """`lines` with the numbers at either end of those near the page's upper and lower edge as lines of their own.

    A number is a word of few glyphs of one height, which are higher than the capitals of the line.
    `page_height` in pixels of the working copy.
    """
    margin = _RUNNING_MARGIN * page_height
    parts: list[Line] = []
    for line in lines:
        middle = (line.box[1] + line.box[3]) / 2
        number = None
        if min(middle, page_height - middle) < margin and len(line.members) >= LONG_LINE:
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
    for own in (slice(spaces[-1] + 1, None), slice(0, spaces[0] + 1)):
        if not 0 < len(members[own]) <= NUMBER_DIGITS:
            continue
        height = boxes[own, 3] - boxes[own, 1]
        if np.ptp(height) > max(1.0, 0.1 * float(np.max(height))):
            continue
        if np.max(np.abs(boxes[own, 3] - line.baseline)) > 0.15 * line.em:
            continue
        rest = measure_line(components, np.delete(members, own))
        if float(np.min(height)) > SIZE_STEP * CAPITAL_HEIGHT * rest.em:
            return np.asarray(members[own], dtype=np.intp)
    return None
