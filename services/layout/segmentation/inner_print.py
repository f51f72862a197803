"""Print within figures: names in a diagram, numbers at its axes, letters of a logo are part of the figure."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from services.layout.segmentation.components import Boxes
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.non_text import Part
from services.layout.segmentation.text_lines import Line, unite_boxes
from services.layout.segmentation.typical_print import FULL_LINE, UNRELIABLE_STEP
from services.order_statistics import median

_LEAST_PICTURE = 0.06
"""Figures of this share of the page's area have what is printed in them; signatures and stamps are smaller."""
SCRAP_COMPONENTS = 6
"""Unread print of at most this many glyphs within a figure is part of it. Elsewhere it may be a piece of a signature or
a stamp."""


def give_to_figures(
    blocks: list[list[int]],
    lines: Sequence[Line],
    is_read: NDArray[np.bool_],
    parts: Sequence[Part],
    levelled: InkComponents,
    page_px: tuple[int, int],
) -> tuple[list[list[int]], list[Part]]:
    """`blocks` that lie in no figure, and `parts` whose figures have the lines of the others.

    `blocks` are indices of `lines`, of which OCR read those of `is_read`. A figure that encloses running text of the
    page's size is a border or an ornament round text, and gets none. A small one, such as a logo, a stamp or a
    signature, gets scraps that were not read.
    """
    if not blocks:
        return blocks, list(parts)
    em = median(np.repeat([line.em for line in lines], [len(line.members) for line in lines]))
    runs = np.array([any(_is_running(lines[index], em) for index in block) for block in blocks])
    hulls = block_boxes(blocks, lines)
    scraps = np.array([_is_scrap(block, lines, is_read) for block in blocks])
    least_area = _LEAST_PICTURE * page_px[0] * page_px[1]
    taken = np.zeros(len(blocks), dtype=bool)
    figures: list[Part] = []
    for part in parts:
        figures.append(part)
        if part.kind == "figure":
            box = unite_boxes(levelled.boxes[part.members], np.zeros(len(part.members), dtype=np.intp))
            inner = lie_within(hulls, box) & ~taken
            if np.prod(box[0, 2:] - box[0, :2]) < least_area:
                inner &= scraps
            if not np.any(inner & runs):
                taken |= inner
                own = [index for row in np.flatnonzero(inner) for index in blocks[row]]
                members = [part.members, *(lines[index].members for index in own)]
                figures[-1] = replace(part, members=np.concatenate(members), lines=(*part.lines, *own))
    return [block for block, is_inner in zip(blocks, taken, strict=True) if not is_inner], figures


def block_boxes(blocks: Sequence[Sequence[int]], lines: Sequence[Line]) -> Boxes:
    """Box of every block of lines, (B, 4)."""
    boxes = np.array([line.box for line in lines]).reshape(-1, 4)
    hulls = [np.append(boxes[list(b), :2].min(axis=0), boxes[list(b), 2:].max(axis=0)) for b in blocks]
    return np.array(hulls).reshape(-1, 4)


def lie_within(boxes: Boxes, regions: Boxes) -> NDArray[np.bool_]:
    """Which of `boxes` (N, 4) lie by most of their area in one of `regions` (M, 4)."""
    area = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
    within = np.zeros(len(boxes), dtype=bool)
    for x0, y0, x1, y1 in regions:
        across = np.minimum(boxes[:, 2], x1) - np.maximum(boxes[:, 0], x0)
        down = np.minimum(boxes[:, 3], y1) - np.maximum(boxes[:, 1], y0)
        within |= np.maximum(across, 0.0) * np.maximum(down, 0.0) > 0.6 * area
    return within


def _is_scrap(
    block: Sequence[int],
    lines: Sequence[Line],
    is_read: NDArray[np.bool_],
) -> bool:
    few = sum(len(lines[index].members) for index in block) <= SCRAP_COMPONENTS
    return few and not np.any(is_read[list(block)])


def _is_running(line: Line, em: float) -> bool:
    """Whether a line is as wide as running text is, and about as large as the print of the page."""
    return line.em > em / UNRELIABLE_STEP and line.width > FULL_LINE * line.em
