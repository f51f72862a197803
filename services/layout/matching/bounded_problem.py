"""A reparametrisation of the matching problem without negative terms: its constant is a lower bound.

A reparametrisation moves cost between the terms of a pairwise energy and does not change the cost of any labelling.
When all terms are at least 0, the constant is at most the least cost. A label whose term exceeds the gap between a
known cost and the constant cannot be in a better labelling, and is removed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.matching.cost_tables import CostTables
from services.layout.matching.labelling import Floats, Labels, Neighbours


@dataclass(slots=True, eq=False)
class BoundedProblem:
    """The undecided part of the problem: R zones with at most K labels each, without negative terms.

    The cost of choosing `choice` (R,) of places is

        constant + sum_r node[r, c_r] + sum_e pair[e, c_i, c_j] + sum_l count[l, n_l]

    `names` (R, K) are the labels at these places, the first `sizes[r]` of them; the places after repeat the first
    one. `zones` (R,) are the tables' zones and `labels` (N,) has those that are decided; n_l counts the zones
    left only. `pair` (E', K, K) belongs to the places of `low` < `high` (E',), in the order of `low`.
    `count` (L, R + 1) is infinite where no choice leads.
    """

    constant: float
    node: Floats
    pair: Floats
    low: NDArray[np.intp]
    high: NDArray[np.intp]
    count: Floats
    names: Labels
    sizes: NDArray[np.intp]
    zones: NDArray[np.intp]
    labels: Labels

    @property
    def size(self) -> int:
        return len(self.zones)

    @property
    def real(self) -> NDArray[np.bool_]:
        """(R, K): whether a place is a label of its own."""
        return np.arange(self.names.shape[1]) < self.sizes[:, None]

    def normalise(self) -> None:
        """Move the least value of every zone, pair and count into the constant."""
        least = self.node.min(1)
        self.node -= least[:, None]
        self.constant += float(least.sum())
        self.normalise_counts()

    def normalise_counts(self) -> None:
        least = self.count.min(1)
        self.count -= least[:, None]
        self.constant += float(least.sum())

    def move_counts(self, price: Floats) -> None:
        """Add `price` (L,) to every zone's label costs, and subtract it in the count costs."""
        self.node += price[self.names]
        self.count -= price[:, None] * np.arange(self.count.shape[1])
        self.normalise()

    def labelling(self, choice: Labels) -> Labels:
        """Labels (N,) of all zones for places (R,)."""
        labels = self.labels.copy()
        labels[self.zones] = self.names[np.arange(self.size), choice]
        return labels


def whole_problem(tables: CostTables, neighbours: Neighbours) -> BoundedProblem:
    """The tables as they are, with every label of every zone."""
    least = neighbours.edge.min(axis=(1, 2)) if len(neighbours.low) else np.zeros(0)
    problem = BoundedProblem(
        constant=float(least.sum()),
        node=tables.node.copy(),
        pair=neighbours.edge - least[:, None, None],
        low=neighbours.low,
        high=neighbours.high,
        count=tables.count.copy(),
        names=np.broadcast_to(np.arange(tables.labels), (tables.zones, tables.labels)).copy(),
        sizes=np.full(tables.zones, tables.labels),
        zones=np.arange(tables.zones),
        labels=np.zeros(tables.zones, np.intp),
    )
    problem.normalise()
    return problem


def reduced(problem: BoundedProblem, keep: NDArray[np.bool_]) -> BoundedProblem:
    """The problem with the places (R, K) of `keep` alone, at least one a zone; zones with one left are decided."""
    keep = keep & problem.real
    sizes = keep.sum(1)
    width = max(1, int(sizes.max(initial=1)))
    places = np.argsort(~keep, axis=1, kind="stable")[:, :width]
    places = np.where(np.arange(width) < sizes[:, None], places, places[:, :1])
    rows = np.arange(problem.size)[:, None]
    node = problem.node[rows, places]
    names = problem.names[rows, places]
    pair = problem.pair[
        np.arange(len(problem.pair))[:, None, None],
        places[problem.low][:, :, None],
        places[problem.high][:, None, :],
    ]
    free = sizes > 1
    left = np.flatnonzero(free)
    # a decided zone's pairs become costs of their other zone alone
    low_free, high_free = free[problem.low], free[problem.high]
    np.add.at(node, problem.low[~high_free], pair[~high_free][:, :, 0])
    np.add.at(node, problem.high[low_free < high_free], pair[low_free < high_free][:, 0])
    labels, decided = problem.labels.copy(), ~free
    labels[problem.zones[decided]] = names[decided, 0]
    fixed = np.bincount(names[decided, 0], minlength=len(problem.count))
    possible = np.zeros(len(problem.count), np.intp)
    real = np.arange(width) < sizes[:, None]
    np.add.at(possible, names[left][real[left]], 1)
    steps = np.arange(len(left) + 1)
    shifted = np.minimum(fixed[:, None] + steps, problem.count.shape[1] - 1)
    count = np.take_along_axis(problem.count, shifted, 1)
    count[steps > possible[:, None]] = np.inf
    place = np.cumsum(free) - 1
    both = low_free & high_free
    out = BoundedProblem(
        constant=problem.constant + float(node[decided, 0].sum()),
        node=node[left],
        pair=pair[both],
        low=place[problem.low[both]],
        high=place[problem.high[both]],
        count=count,
        names=names[left],
        sizes=sizes[left],
        zones=problem.zones[left],
        labels=labels,
    )
    out.normalise()
    return out
