"""Zones of text: lines linked to the next below, and divided where size, weight, leading or indent change."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from services.layout.segmentation.components import Boxes, Indices
from services.layout.segmentation.ink import Components
from services.layout.segmentation.notes import note_starts
from services.layout.segmentation.parameters import SegmentationParameters
from services.layout.segmentation.text_lines import Line


def group_lines(
    lines: Sequence[Line],
    begins: set[int],
    components: Components,
    page_height: float,
    parameters: SegmentationParameters,
) -> list[list[int]]:
    """Indices of the lines of every zone, from the top down; the lines `begins` begin a zone each.

    `components` are those that the lines' members number; `page_height` in their pixels.
    """
    blocks: list[list[int]] = []
    foot = parameters.foot_of_text * page_height
    chains = _chains(lines, parameters)
    for part in (part for chain in chains for part in _cut(chain, _positions(chain, begins))):
        for block in _split_at_leading(lines, part, parameters):
            for note in _cut(block, note_starts(lines, block, components, foot, parameters)):
                blocks.extend(_split_paragraphs(lines, note, parameters))
    return blocks


def _chains(lines: Sequence[Line], parameters: SegmentationParameters) -> list[list[int]]:
    """Lines linked to the one next below where it is theirs alone, and set alike."""
    if not lines:
        return []
    below = _next_below(lines, parameters)
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


def _next_below(lines: Sequence[Line], parameters: SegmentationParameters) -> dict[int, int]:
    boxes: Boxes = np.array([line.box for line in lines])
    baseline = np.array([line.baseline for line in lines])
    em = np.array([line.em for line in lines])
    shared = np.minimum(boxes[:, None, 2], boxes[None, :, 2]) - np.maximum(
        boxes[:, None, 0], boxes[None, :, 0]
    )
    down = baseline[None, :] - baseline[:, None]
    smaller = np.minimum(em[:, None], em[None, :])
    reachable = (shared > 0) & (down > 0.4 * smaller)
    reachable &= down < parameters.double_leading * np.maximum(em[:, None], em[None, :])
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
    alike = {i for i, j in pairs.items() if _set_alike(lines[i], lines[j], parameters)}
    for i, j in pairs.items():
        if j in pairs and _is_odd_one(lines[i], lines[j], lines[pairs[j]], parameters):
            alike |= {i, j}
    return {i: j for i, j in pairs.items() if i in alike}


def _is_odd_one(above: Line, line: Line, below: Line, parameters: SegmentationParameters) -> bool:
    """Whether a line stands in a column of print like any other of it, and only its size or weight are told apart.

    Few capitals, or letters whose strokes touch, mislead both.
    """
    if not _set_alike(above, replace(below, baseline=line.baseline), parameters):
        return False
    em = max(above.em, below.em)
    leadings = line.baseline - above.baseline, below.baseline - line.baseline
    even = abs(leadings[0] - leadings[1]) < 0.08 * em and max(leadings) < parameters.largest_leading * em
    edges = np.array([each.box for each in (above, line, below)])
    left = float(np.ptp(edges[:, 0])) < parameters.edge_slack * em
    right = float(np.ptp(edges[:2, 2])) < parameters.edge_slack * em
    return even and left and right and line.width > parameters.narrow * em


def _set_alike(first: Line, second: Line, parameters: SegmentationParameters) -> bool:
    """Whether two lines may be of one block: of one size and weight, not too far apart."""
    reliable = min(len(first.members), len(second.members)) >= parameters.reliable_components
    size = max(first.em, second.em) / min(first.em, second.em)
    if size > parameters.unreliable_step:
        return False
    small = max(first.small, second.small) / min(first.small, second.small)
    if reliable and size > parameters.size_step and small > parameters.small_step:
        return False
    distance = second.baseline - first.baseline
    em = max(first.em, second.em)
    if first.slant is not None and second.slant is not None:
        # In running text a line may be in italics by chance; centred lines are parts of a title.
        middles = abs(sum(first.box[::2]) - sum(second.box[::2])) / 2
        centred = middles < em and abs(first.box[0] - second.box[0]) > em
        if centred and abs(first.slant - second.slant) > parameters.slant_step:
            return False
    weights = first.stroke / first.em, second.stroke / second.em
    if reliable and max(weights) > parameters.weight_step * min(weights):
        narrow = max(first.width, second.width) < parameters.narrow * em
        edges = min(abs(first.box[0] - second.box[0]), abs(first.box[2] - second.box[2]))
        if not narrow or edges > parameters.edge_slack * em or distance > parameters.tight * em:
            return False
    if distance > parameters.largest_leading * em:
        return min(first.width, second.width) > 12 * em
    return True


def _split_at_leading(
    lines: Sequence[Line], chain: list[int], parameters: SegmentationParameters
) -> list[list[int]]:
    """Parts of a chain within which the distance of baselines is even."""
    distance = np.diff([lines[index].baseline for index in chain])
    if len(distance) == 0:
        return [chain]
    padded = np.concatenate([[np.inf], distance, [np.inf]])
    beside = np.minimum(padded[:-2], padded[2:])
    cuts = distance > parameters.leading_step * beside
    # Two lines alone have nothing to compare with.
    em = np.array([max(lines[a].em, lines[b].em) for a, b in pairwise(chain)])
    cuts |= ~np.isfinite(beside) & (distance > 1.5 * em)
    ends = _right_margin(lines, chain) - np.array([lines[index].box[2] for index in chain[:-1]])
    cuts |= (distance > parameters.paragraph_leading * em) & (ends > parameters.early_end * em)
    return _cut(chain, np.flatnonzero(cuts) + 1)


def _right_margin(lines: Sequence[Line], chain: list[int]) -> float:
    """Where full lines of a chain's column end: of its own lines, and of others with its left edge and size."""
    own = [lines[index] for index in chain]
    left, em = min(line.box[0] for line in own), max(line.em for line in own)
    beside = (line for line in lines if abs(line.box[0] - left) < em and line.em < 1.3 * em)
    return max(line.box[2] for line in (*own, *beside))


def _positions(chain: list[int], begins: set[int]) -> NDArray[np.intp]:
    return np.array([place for place, index in enumerate(chain) if index in begins], dtype=np.intp)


def _split_paragraphs(
    lines: Sequence[Line], block: list[int], parameters: SegmentationParameters
) -> list[list[int]]:
    """A block cut before indented first lines."""
    if len(block) < 2:
        return [block]
    left = np.array([lines[index].box[0] for index in block])
    right = np.array([lines[index].box[2] for index in block])
    em = float(np.median([lines[index].em for index in block]))
    step = np.diff(left)
    indented = np.zeros(len(block), dtype=bool)
    indented[1:] = (step > parameters.indent * em) & (step < parameters.largest_indent * em)
    back = np.zeros(len(block), dtype=bool)
    back[1:-1] = np.abs(left[2:] - left[:-2]) < 0.5 * parameters.indent * em
    back[-1] = len(block) > 2 and abs(left[-2] - np.median(left)) < 0.5 * parameters.indent * em
    full = right > right.max() - 0.35 * (right.max() - left.min())
    cuts = indented & back & full
    return _cut(block, np.flatnonzero(cuts))


def _cut(items: list[int], at: NDArray[np.intp] | Indices) -> list[list[int]]:
    edges = [0, *(int(index) for index in at), len(items)]
    return [items[a:b] for a, b in pairwise(edges) if b > a]
