"""Zones of a recognized page put together where they are pieces of one zone (5.4), by judging whole sets of them.

Joins of pairs give a tree (`piece_tree`). A grouping of the page is a set of its nodes that has every zone once. Its
probability is a product over its nodes that are joined,

    P(G) ~ exp(sum of score(node)),

so that exponentials of scores, summed over all groupings below a node, follow from those of its two children. From them
follows how probable each node is as one of the true zones. The grouping that is taken has most true zones in
expectation: two pieces are put together where that is more than twice as probable as that both are right alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from services.layout.grouping.piece_pairs import (
    MOST_ZONES,
    PAIR_WEIGHTS,
    Values,
    describe_pieces,
    joining_of,
    print_size,
)
from services.layout.grouping.piece_tree import PieceTree, grow_tree
from services.layout.model.layout_model import PieceStatistics
from services.layout.page import Page, Zone
from services.layout.recognition.results import RecognizedZone

_MOST_ODDS = 5.0
"""Of a pair; larger ones count as this."""
_MOST_EVIDENCE = 6.0
_USUAL_DIVIDED = 0.15
"""Share of the verified zones of a label that segmentation divides, as if `USUAL_ZONES` had been seen."""
SPREAD = 0.5
"""Standard deviation of the binary logarithms of widths and heights within a label, as if `USUAL_ZONES` had
been seen."""
USUAL_ZONES = 2.0
_MOST_NOISE = 3


WHOLE_FEATURES = (
    "weakest",
    "offered",
    "evidence",
    "divided",
    "size",
    "area",
    "lines",
    "noise",
    "constant",
)
"""What is measured of a node that is joined; `whole_features` has their order."""

WHOLE_WEIGHTS = (0.788, -0.446, 0.159, 0.242, -1.458, -0.466, 0.61, -1.624, -0.817)
"""Score for each feature, as `python -m benchmarks layout_joins` learns them."""

Groups = tuple[tuple[int, ...], ...]
"""Places of the zones of a page that become one zone, in the order of the page; a zone alone is a group, too."""


def find_groups(
    zones: Sequence[RecognizedZone], page: Page, learned: Mapping[str, PieceStatistics]
) -> Groups:
    """Groups of zones that are pieces of one, by what the class has `learned` of its labels."""
    if len(zones) > MOST_ZONES or len(zones) < 2:
        return tuple((place,) for place in range(len(zones)))
    tree, features = describe_joins(zones, page, learned, PAIR_WEIGHTS)
    probability = whole_probabilities(tree, features @ WHOLE_WEIGHTS)
    return choose_groups(tree, probability)


def describe_joins(
    zones: Sequence[RecognizedZone],
    page: Page,
    learned: Mapping[str, PieceStatistics],
    pair_weights: Sequence[float],
) -> tuple[PieceTree, Values]:
    """The tree of joins of a page, and `WHOLE_FEATURES` (M, 9) of its nodes, 0 for those that are no join."""

    em = print_size(page)
    labelled = [_labelled(each) for each in zones]
    pieces, names = describe_pieces(labelled, em)
    tree = grow_tree(pieces, joining_of(names, learned), pair_weights)
    features = np.zeros((len(tree.members), len(WHOLE_FEATURES)))
    evidence = np.clip(
        [0.0 if each.evidence is None else each.evidence for each in zones], -_MOST_EVIDENCE, _MOST_EVIDENCE
    )
    noise = np.array([each.zone.kind in ("rule", "noise") for each in zones], np.float64)
    joins = np.arange(tree.zones, len(tree.members))
    if not len(joins):
        return tree, features
    sides = np.maximum((tree.pieces.boxes[joins, 2:] - tree.pieces.boxes[joins, :2]), 1e-3)
    shares = np.log2(np.maximum(sides * em / np.array([page.width, page.height]), 1e-3))
    known = [learned.get(label or "", PieceStatistics()) for label in names]
    labels = tree.pieces.labels[joins]
    features[joins] = np.column_stack(
        [
            np.clip(tree.weakest[joins], -_MOST_ODDS, _MOST_ODDS),
            np.clip(tree.offered[joins], -_MOST_ODDS, _MOST_ODDS),
            [float(evidence[list(tree.members[node])].mean()) for node in joins],
            np.array([_divided(each) for each in known])[labels],
            _unlikely_size(shares, [known[label] for label in labels]),
            np.log(np.maximum(sides.prod(axis=1), 1e-6)),
            np.log1p(tree.pieces.lines[joins]),
            [min(float(noise[list(tree.members[node])].sum()), _MOST_NOISE) for node in joins],
            np.ones(len(joins)),
        ]
    )
    return tree, features


def whole_probabilities(tree: PieceTree, scores: Values) -> Values:
    """Probability (M,) of each node to be a zone of the grouping, by the scores (M,) of joins."""
    sums = np.zeros(len(scores))
    joins = range(tree.zones, len(scores))
    for node in joins:
        a, b = tree.children[node]
        sums[node] = np.logaddexp(scores[node], sums[a] + sums[b])
    reached = tree.is_root.astype(np.float64)
    taken = reached.copy()
    for node in reversed(joins):
        taken[node] = reached[node] * np.exp(scores[node] - sums[node])
        reached[tree.children[node]] = reached[node] - taken[node]
    taken[: tree.zones] = reached[: tree.zones]
    return taken


def choose_groups(tree: PieceTree, probability: Values) -> Groups:
    """The grouping that has most zones in expectation, by the probabilities (M,) of nodes; where equal, fewer joins."""
    best = probability.copy()
    for node in range(tree.zones, len(best)):
        best[node] = max(probability[node], best[tree.children[node]].sum())
    groups, open_nodes = [], np.flatnonzero(tree.is_root).tolist()
    while open_nodes:
        node = open_nodes.pop()
        if node < tree.zones or probability[node] > best[tree.children[node]].sum():
            groups.append(tuple(sorted(tree.members[node])))
        else:
            open_nodes += tree.children[node].tolist()
    return tuple(sorted(groups))


def _labelled(each: RecognizedZone) -> Zone:
    return replace(each.zone, label=each.label)


def _divided(learned: PieceStatistics) -> float:
    """Log odds, beyond the usual ones, that segmentation divides a zone of the label."""
    divided = learned.divided + USUAL_ZONES * _USUAL_DIVIDED
    whole = learned.whole + USUAL_ZONES * (1 - _USUAL_DIVIDED)
    return float(np.log(divided / whole) - np.log(_USUAL_DIVIDED / (1 - _USUAL_DIVIDED)))


def _unlikely_size(shares: Values, learned: Sequence[PieceStatistics]) -> Values:
    """How little binary logarithms of sides of joins (J, 2) are like those of verified zones; 0 where none is known."""
    sums = np.array([(each.widths, each.heights) for each in learned])
    count = np.maximum(sums[:, :, 0], 1e-9)
    mean = sums[:, :, 1] / count
    squares = np.maximum(sums[:, :, 2] - count * mean**2, 0.0)
    variance = (squares + USUAL_ZONES * SPREAD**2) / (count + USUAL_ZONES) * (1 + 1 / count)
    unlikely = np.log1p((shares - mean) ** 2 / (4 * variance)).sum(axis=1)
    return np.where(sums[:, 0, 0] >= 0.5, unlikely, 0.0)
