"""The tree of joins of a page: neighbours put together, the most probable pair first.

Most of the tree is not used in the end: what a whole zone is like decides how far up the joins go (`joining`)."""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.grouping.piece_pairs import Pieces, Places, Values, are_neighbours, pair_features


@dataclass(frozen=True, slots=True, eq=False)
class PieceTree:
    """N zones, and behind them the nodes that join two earlier nodes each; M nodes in all.

    `children` (M, 2) are -1 for zones; `is_root` (M,) nodes are part of no other. `weakest` (M,) are the log odds of
    the least probable join within a node, infinite for zones; `offered` (M,) those of its most probable join with
    another piece, taken or not, minus infinity where it has no neighbour. `members` are the zones of each node.
    """

    pieces: Pieces
    zones: int
    children: Places
    is_root: NDArray[np.bool_]
    weakest: Values
    offered: Values
    members: tuple[tuple[int, ...], ...]


def grow_tree(pieces: Pieces, joining: Values, weights: Sequence[float]) -> PieceTree:
    """The tree of the pieces of one page.

    Parameters
    ----------
    pieces
        (N,) zones of the page.
    joining
        (L,) log odds that the class adds for each label.
    weights
        Log odds for each of `PAIR_FEATURES`.
    """
    count = len(pieces.labels)
    grown = pieces.with_room(count)
    children = np.full((2 * count, 2), -1, np.intp)
    is_root = np.zeros(2 * count, bool)
    is_root[:count] = True
    weakest, offered = np.full(2 * count, np.inf), np.full(2 * count, -np.inf)
    members: list[tuple[int, ...]] = [(place,) for place in range(count)]
    queue: list[tuple[float, int, int]] = []

    def offer(first: Places, second: Places) -> None:
        kept = are_neighbours(grown, first, second, pieces)
        first, second = first[kept], second[kept]
        if not len(first):
            return
        odds = pair_features(grown, first, second) @ weights + joining[grown.labels[first]]
        np.maximum.at(offered, first, odds)
        np.maximum.at(offered, second, odds)
        for each, a, b in zip(odds.tolist(), first.tolist(), second.tolist(), strict=True):
            heapq.heappush(queue, (-each, a, b))

    offer(*np.triu_indices(count, 1))
    while queue:
        negative_odds, a, b = heapq.heappop(queue)
        if not (is_root[a] and is_root[b]):
            continue
        node = len(members)
        is_root[[a, b]] = False
        grown.put(node, a, b)
        children[node] = a, b
        weakest[node] = min(-negative_odds, weakest[a], weakest[b])
        members.append(members[a] + members[b])
        others = np.flatnonzero(is_root)
        offer(np.full(len(others), node, np.intp), others)
        is_root[node] = True
    nodes = len(members)
    return PieceTree(
        pieces=grown.taken(slice(nodes)),
        zones=count,
        children=children[:nodes],
        is_root=is_root[:nodes],
        weakest=weakest[:nodes],
        offered=offered[:nodes],
        members=tuple(members),
    )
