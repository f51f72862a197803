"""Notes with narrow spacing at the end of a letter: initials, enclosures, copies."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from services.layout.segmentation.components import Indices
from services.layout.segmentation.entries import WIDEST_LABEL
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.text_lines import Line
from services.layout.segmentation.typical_print import EDGE_SLACK, LEAST_SPACE, WIDEST_VALUE

_SHORTEST_NOTE = 4.8
"""A first line this short at the foot of a letter's text ("JRB:tc", "Encl.") is no name or place."""


def note_starts(
    lines: Sequence[Line],
    block: Sequence[int],
    components: InkComponents,
    foot: float,
) -> Indices:
    """Places in `block` (indices of `lines`, from the top down) at which another note begins.

    A note with its items under each other begins with a mark or label ("cc:") at the block's left edge; the next
    one begins where a line is back there. Below `foot`, a row of the page, a very short first line at
    that edge is a note, too.
    """
    own = [lines[index] for index in block]
    if len(own) < 2:
        return np.zeros(0, dtype=np.intp)
    em = float(np.median([line.em for line in own]))
    left = np.array([line.box[0] for line in own])
    edge = float(np.min(left))
    slack = EDGE_SLACK * em
    at_edge = left - edge < slack
    widest = max(line.width for line in own)
    starts = np.zeros(len(own), dtype=bool)
    if widest < WIDEST_VALUE * em:
        items = np.flatnonzero(~at_edge)
        for head in np.flatnonzero(at_edge[:-1] & ~at_edge[1:]):
            if np.any(np.abs(_word_starts(own[head], components) - left[head + 1]) < 1.5 * slack):
                starts[head] = True
                run = items[items > head]
                ends = head + 1 + int(np.argmin(np.append(~at_edge[head + 1 :], False)))
                if len(run) and ends < len(own):
                    starts[ends] = True
    first = own[0]
    short = first.width < _SHORTEST_NOTE * first.em and at_edge[0] and at_edge[1]
    if short and first.box[1] > foot:
        starts[1] = True
    return np.flatnonzero(starts)


def _word_starts(line: Line, components: InkComponents) -> NDArray[np.float64]:
    """Left edges of the words of a line that follow its first, short one."""
    boxes = components.boxes[line.members]
    boxes = boxes[np.argsort(boxes[:, 0], kind="stable")]
    reach = np.maximum.accumulate(boxes[:, 2])
    starts = boxes[1:, 0][boxes[1:, 0] - reach[:-1] > LEAST_SPACE * line.em]
    return np.asarray(starts[starts - line.box[0] < WIDEST_LABEL * line.em])
