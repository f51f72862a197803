"""Consistency of pairs in their graph: chains between photos, and contradictions."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from services.arrays import Homography, Vector
from services.geometry.homographies import transform_points
from services.mosaic.photo_graph import connect_photos
from services.mosaic.registration.pair_registration import PairRegistration

Pairs = Mapping[tuple[int, int], PairRegistration]
"""Registrations by photo indices, the smaller index first."""
Ways = dict[tuple[int, int], tuple[int, Homography]]
"""By two photo indices i, j: the number of photos between them, and H_i_j along the chain."""
MOST_BETWEEN = 3
"""Largest number of photos between two others along which errors may accumulate."""


def find_ways(pairs: Pairs, order: Sequence[int], starts: Sequence[int] | None = None) -> Ways:
    """Chains with the fewest photos; among equal ones, the chain that starts with the strongest pairs.

    `order` sorts the photos by content, which decides between equally strong pairs. Chains begin at `starts`, else at
    every photo.
    """
    return _follow(pairs, order if starts is None else starts, _by_strength(pairs, order))


def drop_contradictions(
    pairs: Pairs, order: Sequence[int], text_heights_px: Mapping[int, float], tolerance: float
) -> dict[tuple[int, int], PairRegistration]:
    """Pairs that agree with the spanning tree of the strongest ones, to `tolerance` text heights per photo in between.

    A pair outside of that tree is the weakest of the loop that it closes. It is dropped if the loop does not close.
    """
    tree: list[tuple[int, int]] = []
    for edge in _by_strength(pairs, order):
        if not any(edge[0] in part and edge[1] in part for part in connect_photos(order, tree)):
            tree.append(edge)
    ways = _follow(pairs, order, tree)
    kept = {}
    for (a, b), pair in pairs.items():
        between, H_a_b = ways[a, b]
        apart = np.linalg.norm(transform_points(H_a_b, pair.points_b) - pair.points_a, axis=1)
        allowed = tolerance * min(max(between, 1), MOST_BETWEEN) * text_heights_px[a]
        if float(np.median(apart)) <= allowed:
            kept[a, b] = pair
    return kept


def drop_lonely_lines(
    pairs: Pairs,
    order: Sequence[int],
    text_heights_px: Mapping[int, float],
    lines: float,
    phrase: float,
    contradicted: Callable[[Pairs, tuple[int, ...], tuple[int, ...]], bool],
) -> dict[tuple[int, int], PairRegistration]:
    """Pairs without false ones that connect two parts of the graph by a piece of one text line.

    A phrase may be printed twice: 33 equal characters were found at the borders of photos of different places. Print
    across `lines` text heights perpendicular to the lines does not repeat. A piece of one line may connect two parts if
    it is at least `phrase` text heights long, and the parts are not `contradicted` (pairs, photos, photos) where they
    then overlap.
    """

    def size(edge: tuple[int, int]) -> Vector:
        return matched_extent(pairs[edge], text_heights_px)

    kept = {edge: pair for edge, pair in pairs.items() if size(edge)[1] >= lines}
    for edge in _by_strength(pairs, order):
        part_of = {i: part for part in connect_photos(order, kept) for i in part}
        one, other = (part_of[photo] for photo in edge)
        joined = {**kept, edge: pairs[edge]}
        if one == other or (size(edge)[0] >= phrase and not contradicted(joined, one, other)):
            kept = joined
    return {edge: pair for edge, pair in pairs.items() if edge in kept}


def matched_extent(pair: PairRegistration, text_heights_px: Mapping[int, float]) -> Vector:
    """Extent (2,) of the matches, along the lines and perpendicular to them, text heights."""
    return np.asarray(np.ptp(pair.points_a, axis=0) / text_heights_px[pair.a])


def _by_strength(pairs: Pairs, order: Sequence[int]) -> list[tuple[int, int]]:
    rank = {index: n for n, index in enumerate(order)}

    def weakness(edge: tuple[int, int]) -> tuple[float, list[int]]:
        pair = pairs[edge]
        return -float(pair.weights.sum()) * pair.agreement, sorted((rank[edge[0]], rank[edge[1]]))

    return sorted(pairs, key=weakness)


def _follow(pairs: Pairs, starts: Sequence[int], edges: Sequence[tuple[int, int]]) -> Ways:
    """Chains along `edges`, breadth first, from each of `starts`."""
    ways: Ways = {}
    for start in starts:
        reached: dict[int, tuple[int, Homography]] = {start: (-1, np.eye(3))}
        queue = [start]
        for here in queue:
            between, H_start_here = reached[here]
            for a, b in edges:
                there = b if here == a else a
                if here in (a, b) and there not in reached:
                    H = H_start_here @ (pairs[a, b].H_a_b if here == a else np.linalg.inv(pairs[a, b].H_a_b))
                    reached[there] = between + 1, H / H[2, 2]
                    queue.append(there)
        ways |= {(start, end): way for end, way in reached.items() if end != start}
    return ways
