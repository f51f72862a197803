"""Selection of text lines among candidates, which include dirt, scribbles and parts of pictures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.segmentation.components import Boxes, Indices
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.text_lines import Line
from services.layout.segmentation.typical_print import UNRELIABLE_STEP
from services.ocr.engine import UNSURE

_LEAST_EM_PX = 6.0
"""Smaller print on the working copy is noise, since it is not readable."""
LONG_LINE = 8
"""Number of components on a straight baseline that proves a text line."""
_FEW = 3
"""On dirty pages lines with fewer components need words."""
_SIZE_RANGE = (0.6, 1.7)
"""Short lines have sizes within this range of those of a long or read line."""


@dataclass(frozen=True, slots=True, eq=False)
class ReadLines:
    """Text and confidence that OCR read in each of the lines (L,)."""

    texts: list[str]
    confidence: NDArray[np.float64]

    def of_first(self, count: int) -> "ReadLines":
        """Those of the first `count` lines."""
        return ReadLines(self.texts[:count], self.confidence[:count])


def choose_text_lines(
    lines: Sequence[Line],
    read: ReadLines,
    components: InkComponents,
    page_px: tuple[int, int],
) -> NDArray[np.bool_]:
    """Whether each line (L,) is text: read with confidence, or long with a straight baseline, or short and similar.

    A short line must have a size near that of the page's long or read lines, and must not be surrounded by dirt.
    """
    if not lines:
        return np.zeros(0, dtype=bool)
    counts = np.array([len(line.members) for line in lines])
    em = np.array([line.em for line in lines])
    boxes: Boxes = np.array([line.box for line in lines])
    sure = np.asarray(read.confidence >= UNSURE)
    regular = np.array([_is_regular(line, components) for line in lines])
    margin = 0.15 * em
    inside = (boxes[:, 0] > margin) & (boxes[:, 1] > margin)
    inside &= em >= _LEAST_EM_PX
    inside &= (boxes[:, 2] < page_px[0] - margin) & (boxes[:, 3] < page_px[1] - margin)
    long = (counts >= LONG_LINE) & regular & inside
    # This many glyphs in a row are text even where two of its lines touch.
    long |= (counts >= 3 * LONG_LINE) & inside
    known = em[sure & (counts > 2)] if np.any(sure & (counts > 2)) else em[long]
    if len(known) == 0:
        known = em  # A page with a few words on it: nothing shows their size.
    least, most = _SIZE_RANGE
    ratio = em[:, None] / known[None, :]
    alike = np.any((ratio > least) & (ratio < most), axis=1)
    dirt = _dirt(lines, components, long | (regular & inside & alike & (counts > 2)), em)
    # More loose components round a line than its own are dirt.
    clean = dirt <= np.maximum(2, counts)
    short = regular & inside & alike & clean
    few = counts < _FEW
    if _is_dirty(lines, components, long):
        wide = boxes[:, 2] - boxes[:, 0] > 1.2 * (boxes[:, 3] - boxes[:, 1])
        close = np.any(np.abs(np.log(ratio)) < np.log(UNRELIABLE_STEP), axis=1)
        short &= ~few | ((dirt == 0) & close & ((counts > 1) | wide))
    short &= ~(counts < 2) | ((dirt <= 1) & np.array([_may_be_glyph(line, components) for line in lines]))
    return np.asarray(sure | long | short, dtype=np.bool_)


def _is_dirty(lines: Sequence[Line], components: InkComponents, is_long: NDArray[np.bool_]) -> bool:
    """Whether a page has enough loose ink that short lines without words are more often dirt than print."""
    in_lines = sum(len(line.members) for line, long in zip(lines, is_long, strict=True) if long)
    return len(components) - in_lines > 60 + 0.8 * in_lines


def _may_be_glyph(line: Line, components: InkComponents) -> bool:
    """Whether a single component may be a letter, a figure, or a word whose letters touch: no disc, no dash."""
    width, height = line.width, line.height
    fill = float(components.area[line.members[0]]) / (width * height)
    slim = width < 0.5 * height
    return 0.12 * height < width < 12 * height and (fill < 0.65 or slim)


def _is_regular(line: Line, components: InkComponents) -> bool:
    """Whether the feet of a line's components are on its baseline, and none reaches far beyond it."""
    if len(line.members) == 1:
        return 0.3 * line.em < line.height < 1.7 * line.em
    boxes = components.boxes[line.members]
    foot = boxes[:, 3] - components.hang[line.members]
    standing = np.abs(foot - line.baseline) < 0.14 * line.em
    # Descenders hang as low as any print does.
    hanging = np.abs(foot - line.baseline - 0.22 * line.em) < 0.12 * line.em
    height = boxes[:, 3] - boxes[:, 1]
    letters = height > 0.3 * line.em
    if not np.any(letters):
        return False
    share = np.count_nonzero((standing | hanging) & letters) / np.count_nonzero(letters)
    return bool(share >= 0.6 and line.height < 1.7 * line.em)


def _dirt(
    lines: Sequence[Line], components: InkComponents, is_line: NDArray[np.bool_], em: NDArray[np.float64]
) -> Indices:
    """Components round every line (L,), within an em of it, that are neither its own nor a long line's."""
    centre = (components.boxes[:, :2] + components.boxes[:, 2:]) / 2
    loose = np.ones(len(components), dtype=bool)
    for line, clean in zip(lines, is_line, strict=True):
        if clean:
            loose[line.members] = False
    # Of a whole page's pixels few rows and columns hold loose points: the others need no sums.
    columns, x = np.unique(np.maximum(np.rint(centre[loose, 0]), 0), return_inverse=True)
    rows, y = np.unique(np.maximum(np.rint(centre[loose, 1]), 0), return_inverse=True)
    number = np.bincount(y * len(columns) + x, minlength=len(rows) * len(columns))
    total = np.zeros((len(rows) + 1, len(columns) + 1), np.intp)
    total[1:, 1:] = number.reshape(len(rows), len(columns)).cumsum(axis=0).cumsum(axis=1)

    def count_in(boxes: Boxes) -> Indices:
        x0, x1 = (np.searchsorted(columns, np.rint(boxes[:, k])) for k in (0, 2))
        y0, y1 = (np.searchsorted(rows, np.rint(boxes[:, k])) for k in (1, 3))
        return np.asarray(total[y1, x1] - total[y0, x1] - total[y1, x0] + total[y0, x0])

    inner = np.array([line.box for line in lines])
    return count_in(inner + em[:, None] * np.array([-1.0, -1.0, 1.0, 1.0])) - count_in(inner)
