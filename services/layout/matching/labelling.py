"""A labelling that changes zone by zone; it has the cost of every single change ready."""

import numpy as np
from numpy.typing import NDArray

from services.layout.matching.cost_tables import CostTables

Floats = NDArray[np.float64]
Labels = NDArray[np.intp]


class Neighbours:
    """The pairs of the tables by zone.

    `edge` (E, L, L) and `low`, `high` (E,): the pairs in the order of their zones, in any order of the tables.
    `as_low[z]` is the slice of the pairs in which z comes first, `as_high[z]` the indices of those in which it
    comes second; both in the order of the other zone.
    """

    __slots__ = ("as_high", "as_low", "edge", "high", "high_order", "low", "zones")

    def __init__(self, tables: CostTables) -> None:
        self.zones = tables.zones
        low, high = (tables.pairs[:, 0], tables.pairs[:, 1]) if len(tables.pairs) else (_NONE, _NONE)
        edge = tables.edge
        rank = low * self.zones + high
        if np.any(rank[1:] < rank[:-1]):
            order = np.argsort(rank, kind="stable")
            low, high, edge = low[order], high[order], edge[order]
        self.low, self.high, self.edge = low, high, edge
        self.high_order = np.argsort(high, kind="stable")
        starts = np.searchsorted(low, np.arange(self.zones + 1)).tolist()
        ends = np.searchsorted(high[self.high_order], np.arange(self.zones + 1)).tolist()
        self.as_low = [slice(starts[z], starts[z + 1]) for z in range(self.zones)]
        self.as_high = [self.high_order[ends[z] : ends[z + 1]] for z in range(self.zones)]

    def sum_by_zone(self, of_low: Floats, of_high: Floats) -> Floats:
        """Rows (E, K) that pairs give to their first and second zones, summed: (N, K)."""
        out = np.zeros((self.zones, of_low.shape[1]))
        for index, rows in ((self.low, of_low), (self.high[self.high_order], of_high[self.high_order])):
            if len(index):
                starts = np.flatnonzero(np.r_[True, index[1:] != index[:-1]])
                out[index[starts]] += np.add.reduceat(rows, starts, axis=0)
        return out


_NONE = np.zeros(0, np.intp)


class Labelling:
    """Labels with `field` (N, L), a zone's own cost and that of its pairs for each label it might have."""

    __slots__ = ("_rows", "_steps", "count", "counts", "field", "labels", "neighbours")

    def __init__(self, tables: CostTables, neighbours: Neighbours, labels: Labels) -> None:
        self.labels = labels.copy()
        self.neighbours = neighbours
        self.count = tables.count
        self.counts = np.bincount(labels, minlength=tables.labels)
        self._rows = np.arange(tables.zones)
        self._steps = np.arange(tables.labels)
        self.field = tables.node.copy()
        if len(neighbours.low):
            e = np.arange(len(neighbours.low))
            of_low = neighbours.edge[e, :, labels[neighbours.high]]
            of_high = neighbours.edge[e, labels[neighbours.low], :]
            self.field += neighbours.sum_by_zone(of_low, of_high)

    def changes(self) -> Floats:
        """(N, L): what the cost would grow by if zone z alone changed to label l; 0 for its own label."""
        steps, counts, count = self._steps, self.counts, self.count
        now = count[steps, counts]
        more = count[steps, np.minimum(counts + 1, len(self.labels))] - now
        less = count[steps, np.maximum(counts - 1, 0)] - now
        out: Floats = self.field + more
        own = self.field[self._rows, self.labels] - less[self.labels]
        out -= own[:, None]
        out[self._rows, self.labels] = 0.0
        return out

    def change(self, zone: int, label: int) -> None:
        """Give one zone another label."""
        around, old = self.neighbours, int(self.labels[zone])
        after, before = around.as_low[zone], around.as_high[zone]
        tables = around.edge[after]
        self.field[around.high[after]] += tables[:, label] - tables[:, old]
        tables = around.edge[before]
        self.field[around.low[before]] += tables[:, :, label] - tables[:, :, old]
        self.labels[zone] = label
        self.counts[old] -= 1
        self.counts[label] += 1


def conditional_costs(tables: CostTables, labels: Labels) -> Floats:
    """(N, L): the cost of the whole labelling if only zone z had label l instead of its own."""
    if tables.zones == 0:
        return np.zeros((0, tables.labels))
    return tables.cost(labels) + Labelling(tables, Neighbours(tables), labels).changes()


def zone_costs(tables: CostTables, labels: Labels) -> Floats:
    """(N, L): what zones cost with each label, by themselves and in their pairs with zones that keep theirs."""
    return Labelling(tables, Neighbours(tables), labels).field


def own_costs(tables: CostTables, labels: Labels) -> tuple[Floats, Floats]:
    """(N,) and (N,): what zones cost with their labels by themselves, and in all their pairs."""
    rows = np.arange(tables.zones)
    own = tables.node[rows, labels]
    return own, Labelling(tables, Neighbours(tables), labels).field[rows, labels] - own


def backbone_of(tables: CostTables, labels: Labels) -> dict[int, int]:
    """Of each label in use, null left out, its representative zone: the surest one.

    Surest is the zone whose own part of the cost (its node, and its pairs with all others) is least.
    """
    if tables.zones == 0:
        return {}
    field = Labelling(tables, Neighbours(tables), labels).field
    own = field[np.arange(tables.zones), labels]
    used = np.unique(labels[labels > 0])
    return {int(label): int(min(np.flatnonzero(labels == label), key=lambda z: own[z])) for label in used}
