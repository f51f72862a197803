"""Clustering of pages that fit no class: each group may be a class without a model (5.7, 6.2)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import ClusterNode, linkage, to_tree
from scipy.spatial.distance import squareform

from services.layout.discovery.class_samples import FEWEST_PAGES
from services.layout.discovery.page_distance import compare_pages, page_distances
from services.layout.graph.layout_graph import LayoutGraph

_MOST_DISTANCE = 0.5
"""Mean distance of two groups that are joined. Pages of one publication are 0.15 to 0.5 apart, of one kind of
letters 0.4 to 0.7, of two publications 0.47 and more; at 0.5 groups are pure (99 %), at 0.55 no longer (96 %)."""
_MOST_APART = 1.8
"""Largest distance of two joined groups, as a multiple of the mean distance within them. It separates publications
that look similar but vary little within each. Values of 1.6 to 2 split no class."""
_STRICTEST = 0.1
"""Least distance within a group: measurements of one zone differ by this between scans."""
MOST_ZONES = 6000
"""Zones of all pages together. The time grows with the square: 6000 take 20 s. These are 400 title pages, or 12
pages of 500 zones."""
_LEAST_LIKENESS = 0.5
"""Least similarity of corresponding zones of two pages: 98 % of such pairs have the same label."""
_LEAST_SHARE = 0.6
"""Least share of the group's pages that have a recurring zone."""


@dataclass(frozen=True, slots=True)
class RecurringZone:
    """A zone that the pages of a group have in common: its index on each page that has it, by index of the page."""

    zones: dict[int, int]


@dataclass(frozen=True, slots=True)
class PageGroup:
    """Pages that may be of one class, by their indices, rising.

    `typical` is the page that is nearest to the others. `cohesion` is 1 for equal pages, 0 for pages without
    anything in common. `recurring` are the zones of the typical page, in its order, that most pages have: who
    labels one page has labelled these on all.
    """

    pages: tuple[int, ...]
    typical: int
    cohesion: float
    recurring: tuple[RecurringZone, ...]


def choose_pages(graphs: Sequence[LayoutGraph], most_zones: int) -> int:
    """How many of the first pages have at most `most_zones` together; the first one at least."""
    total = np.cumsum([graph.zones for graph in graphs])
    return max(min(1, len(graphs)), int(np.searchsorted(total, most_zones, side="right")))


def group_pages(graphs: Sequence[LayoutGraph]) -> tuple[PageGroup, ...]:
    """Groups of similar pages, the largest first; a page that resembles few others is in no group.

    Average linkage: groups grow while the mean distance between their pages is small; the order of the pages
    has no influence. Of more pages than `most_zones` permits only the first are used. A page without zones is in no
    group.
    """
    graphs = graphs[: choose_pages(graphs, MOST_ZONES)]
    printed = [index for index, graph in enumerate(graphs) if graph.zones]
    if len(printed) < FEWEST_PAGES:
        return ()
    distances = page_distances([graphs[index] for index in printed])
    tree = to_tree(linkage(squareform(distances, checks=False), "average"))
    groups = []
    for members in _gather_groups(tree, distances):
        within = distances[np.ix_(members, members)]
        groups.append(_describe(graphs, [printed[member] for member in members], within))
    return tuple(sorted(groups, key=lambda group: (-len(group.pages), -group.cohesion)))


def _gather_groups(tree: ClusterNode, distances: NDArray[np.float64]) -> Iterator[list[int]]:
    """Members, rising, of the largest groups in the tree whose halves belong together."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        if node.get_count() < FEWEST_PAGES:
            continue
        members = sorted(node.pre_order())
        halves = [node.get_left(), node.get_right()]
        if _belong_together(node.dist, [half.pre_order() for half in halves], distances):
            yield members
        else:
            waiting += halves


def _belong_together(
    apart: float,
    halves: Sequence[Sequence[int]],
    distances: NDArray[np.float64],
) -> bool:
    """Whether two groups that are `apart` in the mean are one; a group of few pages says little of how strict it is."""
    if apart > _MOST_DISTANCE:
        return False
    sizes = sorted(map(len, halves))
    if sizes[1] < FEWEST_PAGES and sizes[0] < 2:
        return True
    blocks = [distances[np.ix_(half, half)] for half in halves]
    pairs = sum(len(half) * (len(half) - 1) for half in halves)
    within = sum(float(block.sum()) for block in blocks) / pairs
    return apart <= _MOST_APART * max(within, _STRICTEST)


def find_medoid(distances: NDArray[np.float64]) -> int:
    """The one of P that is nearest to all others, by their distances (P, P)."""
    return int(np.argmin(distances.sum(axis=1)))


def _describe(
    graphs: Sequence[LayoutGraph],
    pages: Sequence[int],
    distances: NDArray[np.float64],
) -> PageGroup:
    count = len(pages)
    typical = pages[find_medoid(distances)]
    recurring: dict[int, dict[int, int]] = {zone: {typical: zone} for zone in range(graphs[typical].zones)}
    for page in pages:
        if page != typical:
            compared = compare_pages(graphs[typical], graphs[page])
            for zone, other in compared.pairs[compared.likeness >= _LEAST_LIKENESS]:
                recurring[int(zone)][page] = int(other)
    least = _LEAST_SHARE * count
    return PageGroup(
        pages=tuple(pages),
        typical=typical,
        cohesion=float(1 - distances.sum() / (count * (count - 1))),
        recurring=tuple(
            RecurringZone(dict(sorted(zones.items()))) for zones in recurring.values() if len(zones) >= least
        ),
    )
