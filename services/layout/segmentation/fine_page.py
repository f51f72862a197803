"""A page before its lines are grouped for good: text lines, one grouping of them, and what is no text."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from services.layout.page import Box, Page, Zone
from services.layout.read_words import read_words
from services.layout.segmentation.appearance import InkMarks, with_appearance
from services.layout.segmentation.gathering import trim_figures
from services.layout.segmentation.measures import (
    count_rows,
    zone_alignment,
    zone_font_size,
    zone_line_spacing,
    zone_weight,
)
from services.layout.segmentation.reading_order import reading_order
from services.layout.segmentation.text_lines import Line
from services.ocr.engine import Word


@dataclass(frozen=True, slots=True, eq=False)
class FinePage:
    """The lines of a page of `width` x `height` px, from which zones can be made in several ways.

    `lines` (L) lie on the levelled working copy, `boxes` (L, 4) and `words` are in pixels of the page; `scale` is
    pixels of the page per pixel of the working copy. `begins` are lines that begin a zone each (entries of lists);
    `blocks` is the grouping by print alone; `others` are figures, rules and noise. The appearance of
    zones is measured from the marks of `ink`. `loose` are words that are in no line and in none of the others.
    """

    width: float
    height: float
    scale: float
    lines: tuple[Line, ...]
    boxes: NDArray[np.float64]
    texts: tuple[str, ...]
    words: tuple[tuple[Word, ...], ...]
    begins: frozenset[int]
    blocks: tuple[tuple[int, ...], ...]
    others: tuple[Zone, ...]
    ink: InkMarks | None = None
    loose: tuple[Word, ...] = ()

    @property
    def column(self) -> tuple[float, float]:
        """Left and right edge of all lines on the working copy."""
        if not self.lines:
            return 0.0, 0.0
        return min(line.box[0] for line in self.lines), max(line.box[2] for line in self.lines)


def compose_page(fine: FinePage) -> Page:
    """The page whose text zones are `fine.blocks`, in reading order, ids "z1", "z2" ..."""
    return compose_with_lines(fine)[0]


def compose_with_lines(fine: FinePage) -> tuple[Page, tuple[tuple[int, ...], ...]]:
    """`compose_page`, and the lines of every zone of the page; none for a zone that is no text."""
    zones = [text_zone(fine, block) for block in fine.blocks]
    zones = trim_figures([*zones, *fine.others])
    zones = with_appearance(fine.ink, zones)
    order = reading_order([zone.box for zone in zones])
    numbered = tuple(replace(zones[index], id=f"z{number}") for number, index in enumerate(order, 1))
    lines = tuple(tuple(fine.blocks[index]) if index < len(fine.blocks) else () for index in order)
    return Page(fine.width, fine.height, numbered, read_words([fine.loose])), lines


def text_zone(fine: FinePage, block: Sequence[int]) -> Zone:
    """The zone of the lines `block`, without an id and its appearance."""
    lines = [fine.lines[index] for index in block]
    em = zone_font_size(lines)
    spacing = zone_line_spacing(lines)
    read = [index for index in block if fine.texts[index]]
    return Zone(
        id="",
        box=hull(fine.boxes[list(block)]),
        kind="text",
        lines=count_rows(lines),
        font_size=em * fine.scale,
        line_spacing=None if spacing is None else spacing * fine.scale,
        weight=zone_weight(lines),
        alignment=zone_alignment(lines, fine.column, em),
        text="\n".join(fine.texts[index] for index in read),
        words=read_words([fine.words[index] for index in read]),
    )


def hull(boxes: NDArray[np.float64] | Sequence[Box]) -> Box:
    """The box round all of these (N, 4)."""
    corners = np.asarray(boxes, dtype=np.float64)
    (x0, y0), (x1, y1) = corners[:, :2].min(axis=0), corners[:, 2:].max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)
