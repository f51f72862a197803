"""Local search for good labellings: iterated conditional modes, then moves of several zones together."""

import numpy as np

from services.layout.matching.cost_tables import CostTables
from services.layout.matching.labelling import Floats, Labelling, Labels, Neighbours
from services.layout.matching.parameters import LEAST_GAIN

_MOVES_PER_ZONE = 8
"""Of single zones in one descent; more than any page needed, so that no descent is endless."""


def descend(state: Labelling, least_gain: float) -> None:
    """Iterated conditional modes: apply the single change with the largest gain until no change gains."""
    width = state.field.shape[1]
    for _ in range(_MOVES_PER_ZONE * len(state.labels)):
        changes = state.changes()
        best = int(changes.argmin())
        if changes.flat[best] > -least_gain:
            return
        state.change(*divmod(best, width))


def exchange(state: Labelling, least_gain: float) -> bool:
    """Swap the labels of the two zones of one pair if that reduces the cost; return whether it did."""
    around, labels, field = state.neighbours, state.labels, state.field
    first, second = labels[around.low], labels[around.high]
    different = np.flatnonzero(first != second)
    if len(different) == 0:
        return False
    i, j, a, b = around.low[different], around.high[different], first[different], second[different]
    tables = around.edge
    gain = field[i, b] - field[i, a] + field[j, a] - field[j, b]
    gain += (
        tables[different, b, a] - tables[different, b, b] - tables[different, a, a] + tables[different, a, b]
    )
    best = int(gain.argmin())
    if gain[best] > -least_gain:
        return False
    z, w, other, own = int(i[best]), int(j[best]), int(b[best]), int(a[best])
    state.change(z, other)
    state.change(w, own)
    return True


def relabel_together(tables: CostTables, state: Labelling, least_gain: float) -> bool:
    """Give all zones of one label another one, if that gains (as when a paragraph's zones vote together)."""
    labels, counts, around = state.labels, state.counts, state.neighbours
    width = tables.labels
    members = (labels == np.arange(width)[:, None]).astype(float)
    sums: Floats = members @ state.field
    gains = sums - sums.diagonal()[:, None]
    inner = np.flatnonzero(labels[around.low] == labels[around.high])
    if len(inner):
        # a pair inside the group is in both zones' fields, each time with the other's old label
        own = labels[around.low[inner]]
        pair, rows = around.edge[inner], np.arange(len(inner))
        twice = pair.diagonal(0, 1, 2) + pair[rows, own, own][:, None] - pair[rows, own] - pair[rows, :, own]
        np.add.at(gains, own, twice)
    now = tables.count[np.arange(width), counts]
    joined = np.minimum(counts[:, None] + counts, tables.zones)
    gains += tables.count[np.arange(width), joined] - now + (tables.count[:, 0] - now)[:, None]
    gains[counts == 0] = np.inf
    np.fill_diagonal(gains, np.inf)
    best, target = divmod(int(gains.argmin()), width)
    if gains[best, target] > -least_gain:
        return False
    for zone in np.flatnonzero(labels == best):
        state.change(int(zone), target)
    return True


def improve(
    tables: CostTables, neighbours: Neighbours, start: Labels, *, groups: bool = True
) -> tuple[Labels, float]:
    """A labelling that no single change and no exchange makes better, nor (`groups`) a group's change; its cost."""
    least_gain = LEAST_GAIN * (1.0 + abs(tables.cost(start)))
    state = Labelling(tables, neighbours, start)
    for _ in range(4 * tables.zones):
        descend(state, least_gain)
        if exchange(state, least_gain):
            continue
        if not groups or not relabel_together(tables, state, least_gain):
            break
    return state.labels, tables.cost(state.labels)


def starts(tables: CostTables, neighbours: Neighbours) -> list[Labels]:
    """Labellings to begin with, the better first: the zones alone, and with what their pairs expect of them."""
    alone: Labels = tables.node.argmin(1)
    if not len(neighbours.low):
        return [alone, alone]
    # what pairs expect: the other zone's label as likely as its own cost alone says
    weights: Floats = np.exp(np.minimum(tables.node.min(1, keepdims=True) - tables.node, 0.0))
    weights /= weights.sum(1, keepdims=True)
    of_low = np.matmul(neighbours.edge, weights[neighbours.high][:, :, None])[:, :, 0]
    of_high = np.matmul(weights[neighbours.low][:, None, :], neighbours.edge)[:, 0]
    expected = tables.node + neighbours.sum_by_zone(of_low, of_high)
    return sorted([alone, expected.argmin(1)], key=tables.cost)
