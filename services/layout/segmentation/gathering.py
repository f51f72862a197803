"""Merging of scraps: the pieces of a signature, a stamp or a formula become one zone."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from services.geometry.linked_groups import group_linked
from services.layout.page import Zone
from services.layout.segmentation.components import Boxes, Indices, near_pairs
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.inner_print import SCRAP_COMPONENTS
from services.layout.segmentation.non_text import Part
from services.layout.segmentation.text_lines import Line

_SCRAP_GAP = 1.0
"""Scraps belong together where the boxes are nearer, in units."""
_TRIMMED_SHARE = 0.5
"""A figure whose upper part crosses a line of print begins below it, if this share of its height is left."""
_LARGEST_SCRAP = 40.0
"""Longer parts, in units, are not scraps but borders or pictures."""


Blocks = list[list[int]]
"""Indices of the lines of every text zone, from the top down."""


def gather_scraps(
    blocks: Blocks,
    lines: Sequence[Line],
    is_sure: NDArray[np.bool_],
    parts: list[Part],
    components: InkComponents,
    unit: float,
) -> tuple[Blocks, list[Part]]:
    """`blocks` and `parts` in which scraps that nearly touch are figures, or noise where all of them are.

    A scrap is a part without text, but for rules and what is longer than print can be, or a block of few
    glyphs that was not read for sure (`is_sure`, lines). `unit` is the page's glyph height, px.
    """
    few = SCRAP_COMPONENTS
    words = [
        index
        for index, block in enumerate(blocks)
        if not np.any(is_sure[block]) and sum(len(lines[row].members) for row in block) <= few
    ]
    longest = _LARGEST_SCRAP * unit
    boxes_of_parts = [_box(components, part.members) for part in parts]
    loose = [
        index
        for index, (part, box) in enumerate(zip(parts, boxes_of_parts, strict=True))
        if part.kind != "rule" and max(box[2] - box[0], box[3] - box[1]) < longest
    ]
    members = [np.concatenate([lines[row].members for row in blocks[index]]) for index in words]
    members += [parts[index].members for index in loose]
    if len(members) < 2:
        return blocks, parts
    is_text = np.arange(len(members)) < len(words)
    boxes = np.array([_box(components, own) for own in members])
    groups = _near_groups(boxes, is_text, unit)
    gathered: list[Part] = []
    alone = np.bincount(groups)[groups] == 1
    for group in np.unique(groups[~alone]):
        own = np.flatnonzero(groups == group)
        noise = all(index >= len(words) and parts[loose[index - len(words)]].kind == "noise" for index in own)
        inner = [
            row for index in own if index >= len(words) for row in parts[loose[index - len(words)]].lines
        ]
        gathered.append(
            Part(
                np.concatenate([members[index] for index in own]),
                "noise" if noise else "figure",
                tuple(inner),
            )
        )
    taken_words = {words[index] for index in np.flatnonzero(~alone & is_text)}
    taken_parts = {loose[index - len(words)] for index in np.flatnonzero(~alone & ~is_text)}
    return (
        [block for index, block in enumerate(blocks) if index not in taken_words],
        [part for index, part in enumerate(parts) if index not in taken_parts] + gathered,
    )


def trim_figures(zones: Sequence[Zone]) -> list[Zone]:
    """`zones` whose figures begin below the line of print that they cross with their upper end.

    A signature's strokes reach into the closing line above it, which is none of it. A line that lies deeper in a
    figure is its lettering.
    """
    lines = np.array([zone.box for zone in zones if zone.kind == "text" and zone.lines == 1]).reshape(-1, 4)
    trimmed = []
    for zone in zones:
        if zone.kind == "figure" and len(lines):
            x0, y0, x1, y1 = zone.box
            height = lines[:, 3] - lines[:, 1]
            shared = np.minimum(lines[:, 2], x1) - np.maximum(lines[:, 0], x0)
            crossed = (shared > 0.5 * (lines[:, 2] - lines[:, 0])) & (np.abs(lines[:, 1] - y0) < 0.6 * height)
            crossed &= y1 - lines[:, 3] > _TRIMMED_SHARE * (y1 - y0)
            y0 = max(y0, float(np.max(lines[crossed, 3], initial=y0)))
            trimmed.append(replace(zone, box=(x0, y0, x1, y1)))
        else:
            trimmed.append(zone)
    return trimmed


def _near_groups(boxes: Boxes, is_text: NDArray[np.bool_], unit: float) -> Indices:
    """Groups (N,) of boxes that meet when they are grown; text meets what is none, never other text."""
    grown = boxes + _SCRAP_GAP * unit * np.array([-0.5, -0.5, 0.5, 0.5])
    i, j = near_pairs(grown[:, 0], grown[:, 2])
    meet = (grown[i, 1] < grown[j, 3]) & (grown[j, 1] < grown[i, 3]) & ~(is_text[i] & is_text[j])
    return group_linked(len(boxes), i[meet], j[meet])


def _box(components: InkComponents, members: Indices) -> NDArray[np.float64]:
    boxes = components.boxes[members]
    return np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])
