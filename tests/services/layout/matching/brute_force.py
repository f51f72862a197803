"""The least cost by trying everything."""

from itertools import product

import numpy as np

from services.layout.matching.cost_tables import CostTables


def all_labellings(tables: CostTables) -> np.ndarray:
    """(L ** N, N)."""
    return np.array(list(product(range(tables.labels), repeat=tables.zones)), np.intp).reshape(
        -1, tables.zones
    )


def all_costs(tables: CostTables, labellings: np.ndarray) -> np.ndarray:
    """Cost of each labelling, by the definition written out once more."""
    cost = np.zeros(len(labellings))
    for z in range(tables.zones):
        cost += tables.node[z, labellings[:, z]]
    for (i, j), table in zip(tables.pairs.tolist(), tables.edge, strict=True):
        cost += table[labellings[:, i], labellings[:, j]]
    for label in range(tables.labels):
        cost += tables.count[label, (labellings == label).sum(1)]
    return cost


def least_cost(tables: CostTables) -> float:
    return float(all_costs(tables, all_labellings(tables)).min())
