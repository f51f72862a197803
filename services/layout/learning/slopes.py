"""Parameters in which the cost of a labelling is linear: weights of nodes, label costs, look-up tables, count costs."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import RELATION_OFFSETS, LayoutGraph
from services.layout.model.compiled_model import CompiledModel
from services.layout.model.cost import relation_weight, weighted_node_terms


@dataclass(frozen=True, slots=True, eq=False)
class CostSlopes:
    """Derivatives of a cost by the parameters of a model that it is linear in, shaped as these.

    `weights` (L, A + C + W), `label_costs` (L,), `relations` (L, L, D), `counts` (L, M).
    """

    weights: NDArray[np.float64]
    label_costs: NDArray[np.float64]
    relations: NDArray[np.float64]
    counts: NDArray[np.float64]

    def __sub__(self, other: "CostSlopes") -> "CostSlopes":
        return CostSlopes(*(getattr(self, each.name) - getattr(other, each.name) for each in fields(self)))

    def squared(self, rates: "SlopeRates") -> float:
        """Squared length, each group by its rate."""
        return float(
            sum(getattr(rates, each.name) * (getattr(self, each.name) ** 2).sum() for each in fields(self))
        )


@dataclass(frozen=True, slots=True)
class SlopeRates:
    """Relative learning rate of each group of parameters."""

    weights: float = 0.1
    """Weights are 1 where costs are some units, and act on terms of some units."""
    label_costs: float = 1.0
    relations: float = 1.0
    counts: float = 1.0


def cost_slopes(graph: LayoutGraph, model: CompiledModel, labels: NDArray[np.intp]) -> CostSlopes:
    """Slopes of the cost (Equation 5.1) of a labelling (N,)."""
    nodes = len(model.scales) - len(RELATIONS) - 1
    weights = np.zeros_like(model.weights)
    unweighted = replace(model, weights=np.ones_like(model.weights))
    np.add.at(weights, labels, weighted_node_terms(graph, unweighted, labels, model.scales)[:, :-1])
    upper, lower = labels[graph.pairs.T]
    relations = np.zeros_like(model.relations)
    by_relation = model.scales[nodes:-1] * relation_weight(graph.zones)
    descriptors = graph.relations + RELATION_OFFSETS[:-1]
    np.add.at(relations, (upper[:, None], lower[:, None], descriptors), by_relation)
    numbers = np.bincount(labels, minlength=len(model.labels))
    counts = np.zeros_like(model.counts)
    counts[np.arange(len(numbers)), np.minimum(numbers, counts.shape[1] - 1)] = model.scales[-1]
    return CostSlopes(weights, model.scales[nodes - 1] * numbers, relations, counts)


def step_along(model: CompiledModel, slopes: CostSlopes, rates: SlopeRates, size: float) -> CompiledModel:
    """The model after a step of `size` against the slopes; weights stay at zero or above."""
    return replace(
        model,
        weights=np.maximum(model.weights - size * rates.weights * slopes.weights, 0.0),
        label_costs=model.label_costs - size * rates.label_costs * slopes.label_costs,
        relations=model.relations - size * rates.relations * slopes.relations,
        counts=model.counts - size * rates.counts * slopes.counts,
    )
