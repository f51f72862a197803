"""Zones of text: lines linked to the next below, and divided where size, weight, leading or indent change."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from services.layout.segmentation.components import Boxes, Indices
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.notes import note_starts
from services.layout.segmentation.text_lines import RELIABLE_COMPONENTS, Line
from services.layout.segmentation.typical_print import (
    EDGE_SLACK,
    FULL_LINE,
    ROW_REACH,
    SIZE_STEP,
    UNRELIABLE_STEP,
    WEIGHT_STEP,
    WIDEST_VALUE,
)
from services.order_statistics import median

_SLANT_STEP = 0.11
"""Italics lean by 0.2 more than upright letters; figures and capitals blur that."""
_LEADING_STEP = 1.22
"""A line space wider than the next by this factor divides blocks."""
_LARGEST_LEADING = 1.75
"""Wider spacing needs full lines on both sides (a letter in double spacing)."""
_INDENT = 0.7
"""First lines of paragraphs begin by this much to the right of the others, at least."""
_FOOT_OF_TEXT = 0.5
"""Notes after a letter's body are below this share of the page's height."""
_PARAGRAPH_LEADING = 1.45
"""From here on a line that ends early ends its paragraph: the space may be that between paragraphs. Below it a head and
what it heads, narrow lines with an edge in common, stay together, bold or not."""
_EARLY_END = 3.5
"""A line ends early if it leaves this much space: the next word would have fitted."""


def group_lines(
    lines: Sequence[Line],
    begins: set[int],
    components: InkComponents,
    page_height: float,
) -> list[list[int]]:
    """Indices of the lines of every zone, from the top down; the lines `begins` begin a zone each.

    `components` are those that the lines' members number; `page_height` in their pixels.
    """
    blocks: list[list[int]] = []
    foot = _FOOT_OF_TEXT * page_height
    chains = _chains(lines, components)
    marks = _marks(lines, components)
    for part in (part for chain in chains for part in _cut(chain, _positions(chain, begins))):
        for block in _split_at_leading(lines, part, marks):
            for note in _cut(block, note_starts(lines, block, components, foot)):
                blocks.extend(_split_paragraphs(lines, note))
    return blocks


def _chains(lines: Sequence[Line], components: InkComponents) -> list[list[int]]:
    """Lines linked to the one next below where it is theirs alone, and set alike."""
    if not lines:
        return []
    below = _next_below(lines, components)
    above = {j: i for i, j in below.items()}
    chains = []
    for start in range(len(lines)):
        if start in above:
            continue
        chain = [start]
        while chain[-1] in below:
            chain.append(below[chain[-1]])
        chains.append(chain)
    return chains


def _next_below(lines: Sequence[Line], components: InkComponents) -> dict[int, int]:
    boxes: Boxes = np.array([line.box for line in lines])
    baseline = np.array([line.baseline for line in lines])
    em = np.array([line.em for line in lines])
    shared = np.minimum(boxes[:, None, 2], boxes[None, :, 2]) - np.maximum(
        boxes[:, None, 0], boxes[None, :, 0]
    )
    down = baseline[None, :] - baseline[:, None]
    smaller = np.minimum(em[:, None], em[None, :])
    reachable = (shared > 0) & (down > 0.4 * smaller)
    reachable &= down < ROW_REACH * np.maximum(em[:, None], em[None, :])
    distance = np.where(reachable, down, np.inf)
    nearest_below, nearest_above = np.min(distance, axis=1), np.min(distance, axis=0)
    level = 0.5 * em
    of_below = distance <= (nearest_below + level)[:, None]
    of_above = distance <= (nearest_above + level)[None, :]
    linked = of_below & of_above & reachable
    # Side by side with another that has the same line above or below: heads over columns, not a block.
    alone = (np.sum(of_below & reachable, axis=1) == 1)[:, None] & (np.sum(of_above & reachable, axis=0) == 1)
    linked &= alone
    pairs = {int(i): int(j) for i, j in zip(*np.nonzero(linked), strict=True)}
    alike = {i for i, j in pairs.items() if _set_alike(lines[i], lines[j])}
    marks = _marks(lines, components)
    for i, j in pairs.items():
        if _are_items(lines, i, j, marks):
            alike.add(i)
        if j in pairs and _is_odd_one(lines[i], lines[j], lines[pairs[j]]):
            alike |= {i, j}
    return {i: j for i, j in pairs.items() if i in alike}


def _marks(lines: Sequence[Line], components: InkComponents) -> NDArray[np.float64]:
    """Height of the mark that begins every line (L,), a bullet or dash before its first letter; 0 without."""
    heights = np.zeros(len(lines))
    for index, line in enumerate(lines):
        boxes = components.boxes[line.members]
        if len(boxes) < 3:
            continue
        order = np.argsort(boxes[:, 0], kind="stable")
        first, second = boxes[order[0]], boxes[order[1]]
        low = first[3] - first[1] < 0.55 * line.em and first[3] < line.baseline + 0.05 * line.em
        if low and second[0] - first[2] > 0.35 * line.em:
            heights[index] = first[3] - first[1]
    return heights


def _are_items(lines: Sequence[Line], a: int, b: int, marks: NDArray[np.float64]) -> bool:
    """Whether two short lines are items of a list: they have similar marks one below the other, at any distance."""
    em = max(lines[a].em, lines[b].em)
    even = abs(lines[a].box[0] - lines[b].box[0]) < EDGE_SLACK * em
    short = max(lines[a].width, lines[b].width) < WIDEST_VALUE * em
    alike = min(marks[a], marks[b]) > 0 and max(marks[a], marks[b]) < 1.3 * min(marks[a], marks[b])
    return bool(even and short and alike)


def _is_odd_one(above: Line, line: Line, below: Line) -> bool:
    """Whether a line fits its column of print, and differs from it only in the measured size or weight.

    Few capitals, or letters whose strokes touch, mislead both.
    """
    if not _set_alike(above, replace(below, baseline=line.baseline)):
        return False
    em = max(above.em, below.em)
    leadings = line.baseline - above.baseline, below.baseline - line.baseline
    even = abs(leadings[0] - leadings[1]) < 0.08 * em and max(leadings) < _LARGEST_LEADING * em
    edges = np.array([each.box for each in (above, line, below)])
    left = float(np.ptp(edges[:, 0])) < EDGE_SLACK * em
    right = float(np.ptp(edges[:2, 2])) < EDGE_SLACK * em
    return even and left and right and line.width > FULL_LINE * em


def _set_alike(first: Line, second: Line) -> bool:
    """Whether two lines may be of one block: of one size and weight, not too far apart."""
    reliable = min(len(first.members), len(second.members)) >= RELIABLE_COMPONENTS
    size = max(first.em, second.em) / min(first.em, second.em)
    if size > UNRELIABLE_STEP:
        return False
    small = max(first.small, second.small) / min(first.small, second.small)
    if reliable and min(size, small) > SIZE_STEP:
        return False
    distance = second.baseline - first.baseline
    em = max(first.em, second.em)
    if first.slant is not None and second.slant is not None:
        # In running text a line may be in italics by chance; centred lines are parts of a title.
        middles = abs(sum(first.box[::2]) - sum(second.box[::2])) / 2
        centred = middles < em and abs(first.box[0] - second.box[0]) > em
        if centred and abs(first.slant - second.slant) > _SLANT_STEP:
            return False
    weights = first.stroke / first.em, second.stroke / second.em
    if reliable and max(weights) > WEIGHT_STEP * min(weights):
        narrow = max(first.width, second.width) < FULL_LINE * em
        edges = min(abs(first.box[0] - second.box[0]), abs(first.box[2] - second.box[2]))
        if not narrow or edges > EDGE_SLACK * em or distance > _PARAGRAPH_LEADING * em:
            return False
    if distance > _LARGEST_LEADING * em:
        return min(first.width, second.width) > FULL_LINE * em
    return True


def _split_at_leading(lines: Sequence[Line], chain: list[int], marks: NDArray[np.float64]) -> list[list[int]]:
    """Parts of a chain within which the distance of baselines is even."""
    distance = np.diff([lines[index].baseline for index in chain])
    if len(distance) == 0:
        return [chain]
    padded = np.concatenate([[np.inf], distance, [np.inf]])
    beside = np.minimum(padded[:-2], padded[2:])
    cuts = distance > _LEADING_STEP * beside
    # Two lines alone have nothing to compare with.
    em = np.array([max(lines[a].em, lines[b].em) for a, b in pairwise(chain)])
    cuts |= ~np.isfinite(beside) & (distance > 1.5 * em)
    ends = _right_margin(lines, chain) - np.array([lines[index].box[2] for index in chain[:-1]])
    cuts |= (distance > _PARAGRAPH_LEADING * em) & (ends > _EARLY_END * em)
    for place, (a, b) in enumerate(pairwise(chain)):
        if _are_items(lines, a, b, marks):
            cuts[place] = False
    return _cut(chain, np.flatnonzero(cuts) + 1)


def _right_margin(lines: Sequence[Line], chain: list[int]) -> float:
    """Where full lines of a chain's column end: of its own lines, and of others with its left edge and size."""
    own = [lines[index] for index in chain]
    left, em = min(line.box[0] for line in own), max(line.em for line in own)
    beside = (line for line in lines if abs(line.box[0] - left) < em and line.em < 1.3 * em)
    return max(line.box[2] for line in (*own, *beside))


def _positions(chain: list[int], begins: set[int]) -> NDArray[np.intp]:
    return np.array([place for place, index in enumerate(chain) if index in begins], dtype=np.intp)


def _split_paragraphs(lines: Sequence[Line], block: list[int]) -> list[list[int]]:
    """A block cut before indented first lines."""
    if len(block) < 2:
        return [block]
    left = np.array([lines[index].box[0] for index in block])
    right = np.array([lines[index].box[2] for index in block])
    em = median(np.array([lines[index].em for index in block]))
    step = np.diff(left)
    indented = np.zeros(len(block), dtype=bool)
    indented[1:] = step > _INDENT * em
    back = np.zeros(len(block), dtype=bool)
    back[1:-1] = np.abs(left[2:] - left[:-2]) < 0.5 * _INDENT * em
    back[-1] = len(block) > 2 and abs(left[-2] - median(left)) < 0.5 * _INDENT * em
    full = right > right.max() - 0.35 * (right.max() - left.min())
    cuts = indented & back & full
    return _cut(block, np.flatnonzero(cuts))


def _cut(items: list[int], at: NDArray[np.intp] | Indices) -> list[list[int]]:
    edges = [0, *(int(index) for index in at), len(items)]
    return [items[a:b] for a, b in pairwise(edges) if b > a]
