"""Page numbers in the row of a running head or foot: they become lines of their own."""

from collections.abc import Sequence

import numpy as np

from services.layout.segmentation.components import Indices
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.parameters import SegmentationParameters
from services.layout.segmentation.text_lines import Line, measure_line


def split_page_numbers(
    lines: Sequence[Line], components: InkComponents, page_height: float, parameters: SegmentationParameters
) -> list[Line]:
    """`lines` with the numbers at either end of those near the page's upper and lower edge as lines of their own.

    A number is a word of few glyphs of one height, which are higher than the capitals of the line, or far from it.
    `page_height` in pixels of the working copy.
    """
    margin = parameters.running_margin * page_height
    parts: list[Line] = []
    for line in lines:
        middle = (line.box[1] + line.box[3]) / 2
        number = None
        if min(middle, page_height - middle) < margin and len(line.members) >= parameters.running_components:
            number = _find_number(line, components, parameters)
        if number is None:
            parts.append(line)
            continue
        rest = np.setdiff1d(line.members, number)
        parts.extend(measure_line(components, members, parameters) for members in (rest, number))
    return parts


def _find_number(line: Line, components: InkComponents, parameters: SegmentationParameters) -> Indices | None:
    """Components of the number at the right or left end of a line; None without."""
    members = line.members[np.argsort(components.boxes[line.members, 0], kind="stable")]
    boxes = components.boxes[members]
    gaps = boxes[1:, 0] - np.maximum.accumulate(boxes[:, 2])[:-1]
    spaces = np.flatnonzero(gaps > parameters.least_space * line.em)
    if len(spaces) == 0:
        return None
    usual = float(np.median(gaps[spaces]))
    for space, own in ((spaces[-1], slice(spaces[-1] + 1, None)), (spaces[0], slice(0, spaces[0] + 1))):
        if not 0 < len(members[own]) <= parameters.number_digits:
            continue
        height = boxes[own, 3] - boxes[own, 1]
        if np.ptp(height) > max(1.0, 0.1 * float(np.max(height))):
            continue
        if np.max(np.abs(boxes[own, 3] - line.baseline)) > 0.15 * line.em:
            continue
        rest = measure_line(components, np.delete(members, own), parameters)
        capitals = parameters.capital_height * rest.em
        far = gaps[space] > parameters.number_gap * max(usual, parameters.least_space * line.em)
        far &= gaps[space] > parameters.end_gap * line.em and float(np.min(height)) > 0.9 * capitals
        if far or float(np.min(height)) > parameters.number_step * capitals:
            return np.asarray(members[own], dtype=np.intp)
    return None
