"""Figures, rules and noise, from the ink of a page outside its text lines."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.geometry.linked_groups import group_linked
from services.layout.page import Kind
from services.layout.segmentation.components import Boxes, Indices, Kinds, near_pairs
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.text_lines import unite_boxes

_PART_GAP = 2.0
"""Parts of a figure lie nearer to each other, in units."""
_RULE_GAP = 5.0
"""Pieces of one rule are no farther apart, in units."""
_LEAST_PART = 2.5
"""Figures and noise are larger, in units, and figures have a component that is; less is a speck."""
_MOST_PARTS = 60
"""Figures, rules and noise of a page; of more, which is dirt, the smaller ones are left out."""
_LEAST_NOISE = 4.0
"""Noise is larger, in units; less is dirt."""
_BORDER_FIGURE = (0.5, 6.0)
"""Ink at the border of the page is a figure if it fills this share of its box and is at most this elongated."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A zone without text of its own: the components in it, its kind, and the lines of print within a figure."""

    members: Indices
    kind: Kind
    lines: tuple[int, ...] = ()


def find_parts(
    components: InkComponents,
    kinds: Kinds,
    unused: NDArray[np.bool_],
    lines: Boxes,
    unit: float,
    page_px: tuple[int, int],
) -> list[Part]:
    """Parts without text of a page of `page_px` (width, height).

    `unused` (components,) marks those that are in no line, `lines` (L, 4) where the lines lie.
    """
    parts = _rules(components, np.flatnonzero(kinds.rules), lines, unit)
    rest = np.flatnonzero(unused & ~kinds.rules & (kinds.large | kinds.glyphs))
    if len(rest) == 0:
        return parts
    boxes = components.boxes[rest]
    border = _touches_border(boxes, page_px, unit) & ~_is_compact(components, rest)
    frame = _is_frame(components, rest, lines, unit)
    loose = ~border & ~frame
    for index in rest[border]:
        if max(components.width[index], components.height[index]) > _LEAST_PART * unit:
            parts.append(Part(np.array([index]), "noise"))
    parts.extend(Part(np.array([index]), "rule") for index in rest[frame & ~border])
    if np.any(loose):
        parts.extend(_figures(components, rest[loose], unit))
    if len(parts) <= _MOST_PARTS:
        return parts
    ink = [float(np.sum(components.area[part.members])) for part in parts]
    return [parts[index] for index in sorted(np.argsort(ink)[-_MOST_PARTS:])]


def without_dirt(parts: list[Part], components: InkComponents, unit: float) -> list[Part]:
    """`parts` without small noise."""

    def size(part: Part) -> float:
        [box] = unite_boxes(components.boxes[part.members], np.zeros(len(part.members), dtype=np.intp))
        return float(max(box[2] - box[0], box[3] - box[1]))

    return [part for part in parts if part.kind != "noise" or size(part) > _LEAST_NOISE * unit]


def _figures(components: InkComponents, members: Indices, unit: float) -> list[Part]:
    boxes = components.boxes[members]
    grown = boxes + _PART_GAP * unit * np.array([-0.5, -0.5, 0.5, 0.5])
    i, j = near_pairs(grown[:, 0], grown[:, 2])
    meet = (grown[i, 1] < grown[j, 3]) & (grown[j, 1] < grown[i, 3])
    groups = group_linked(len(boxes), i[meet], j[meet])
    united = unite_boxes(boxes, groups)
    parts = []
    sides = united[:, 2:] - united[:, :2]
    for group in np.flatnonzero(np.max(sides, axis=1) > _LEAST_PART * unit):
        own = members[groups == group]
        largest = float(np.max(components.boxes[own, 2:] - components.boxes[own, :2]))
        # Dirt is many small things of which none is large.
        kind: Kind = "figure" if largest > _LEAST_PART * unit else "noise"
        if np.min(sides[group]) > 0.5 * unit:
            parts.append(Part(own, kind))
    return parts


def _rules(
    components: InkComponents,
    members: Indices,
    lines: Boxes,
    unit: float,
) -> list[Part]:
    """Rules but underlines, which belong to the line above them."""
    if len(members) == 0:
        return []
    parts = []
    groups = _rule_pieces(components.boxes[members], unit)
    for number, (x0, y0, x1, y1) in enumerate(unite_boxes(components.boxes[members], groups)):
        if len(lines):
            under = (lines[:, 3] > y0 - 0.6 * unit) & (lines[:, 1] < y0) & (lines[:, 3] < y1 + 1.0 * unit)
            covered = np.minimum(lines[:, 2], x1) - np.maximum(lines[:, 0], x0)
            if np.any(under & (covered > 0.7 * (x1 - x0))):
                continue
        parts.append(Part(members[groups == number], "rule"))
    return parts


def _rule_pieces(boxes: Boxes, unit: float) -> Indices:
    """Groups (N,) of rules' boxes that continue each other along the rows or the columns."""
    groups = []
    for along, across in ((0, 1), (1, 0)):
        length, thickness = (boxes[:, each + 2] - boxes[:, each] for each in (along, across))
        low = boxes[:, along] - 0.5 * _RULE_GAP * unit
        i, j = near_pairs(low, boxes[:, along + 2] + 0.5 * _RULE_GAP * unit)
        centre = (boxes[:, across] + boxes[:, across + 2]) / 2
        level = np.abs(centre[i] - centre[j]) < 0.3 * unit
        level &= (length[i] > thickness[i]) & (length[j] > thickness[j])
        # They do not lie side by side: a double rule is two rules.
        shared = np.minimum(boxes[i, along + 2], boxes[j, along + 2]) - np.maximum(
            boxes[i, along], boxes[j, along]
        )
        level &= shared < unit
        groups.append((i[level], j[level]))
    first, second = (np.concatenate([pair[k] for pair in groups]) for k in (0, 1))
    return group_linked(len(boxes), first, second)


def _touches_border(boxes: Boxes, page_px: tuple[int, int], unit: float) -> NDArray[np.bool_]:
    margin = 0.3 * unit
    return np.asarray(
        (boxes[:, 0] < margin)
        | (boxes[:, 1] < margin)
        | (boxes[:, 2] > page_px[0] - margin)
        | (boxes[:, 3] > page_px[1] - margin)
    )


def _is_compact(components: InkComponents, members: Indices) -> NDArray[np.bool_]:
    """Solid ink of moderate shape: a picture set to the page's border, not the shadow at a page's edge."""
    boxes = components.boxes[members]
    sides = boxes[:, 2:] - boxes[:, :2]
    fill, longest = _BORDER_FIGURE
    compact = components.area[members] > fill * np.prod(sides, axis=1)
    return np.asarray(compact & (np.max(sides, axis=1) < longest * np.min(sides, axis=1)))


def _is_frame(components: InkComponents, members: Indices, lines: Boxes, unit: float) -> NDArray[np.bool_]:
    """Thin ink round text: boxes, the grids of forms, and borders of which some sides are seen."""
    boxes = components.boxes[members]
    sides = boxes[:, 2:] - boxes[:, :2]
    frame = (components.area[members] < 0.12 * np.prod(sides, axis=1)) & (np.min(sides, axis=1) > 3 * unit)
    for index in np.flatnonzero(frame):
        x0, y0, x1, y1 = boxes[index]
        inside = (lines[:, 0] > x0) & (lines[:, 1] > y0) & (lines[:, 2] < x1) & (lines[:, 3] < y1)
        covered = np.sum(np.prod(lines[inside, 2:] - lines[inside, :2], axis=1))
        # Most fields of a form are filled in; the squares of a plot are not.
        is_form = np.count_nonzero(inside) >= max(3, 0.5 * components.cells[members[index]])
        frame[index] = covered > 0.1 * (x1 - x0) * (y1 - y0) or (
            components.cells[members[index]] > 2 and is_form
        )
    return np.asarray(frame | components.is_border[members])
