"""The objective of matching: the cost of every labelling of the zones of one page (Equation 5.1)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class CostTables:
    """Costs of labelling N zones with L labels; label 0 is null, label m > 0 the model node m - 1.

    A labelling is one label for each zone; several zones may share a model node and some may have none. Its cost is

        sum_z node[z, l_z] + sum_e edge[e, l_i, l_j] + sum_l count[l, n_l]

    where pair e joins the zones (i, j) = pairs[e], i < j, and n_l is how many zones have label l.

    `node` (N, L), `pairs` (E, 2) of indices, no pair twice, `edge` (E, L, L), `count` (L, N + 1); float64
    and finite. The costs may be negative.
    """

    node: NDArray[np.float64]
    pairs: NDArray[np.intp]
    edge: NDArray[np.float64]
    count: NDArray[np.float64]

    @property
    def zones(self) -> int:
        return int(self.node.shape[0])

    @property
    def labels(self) -> int:
        return int(self.node.shape[1])

    def cost(self, labels: NDArray[np.intp]) -> float:
        """Cost of a labelling (N,), by the definition above."""
        i, j = self.pairs.T
        counts = np.bincount(labels, minlength=self.labels)
        return float(
            self.node[np.arange(self.zones), labels].sum()
            + self.edge[np.arange(len(self.pairs)), labels[i], labels[j]].sum()
            + self.count[np.arange(self.labels), counts].sum()
        )


@dataclass(frozen=True, slots=True, eq=False)
class Matching:
    """The labelling that was found: `labels` (N,), its `cost`, and a lower bound of the least cost.

    `lower_bound` <= least cost <= `cost`; `optimal` says that they are proved equal (to rounding).
    `explored` counts the nodes of the search tree.
    """

    labels: NDArray[np.intp]
    cost: float
    lower_bound: float
    optimal: bool
    explored: int

    @property
    def gap(self) -> float:
        """Largest possible difference between the cost and the least cost."""
        return max(0.0, self.cost - self.lower_bound)
