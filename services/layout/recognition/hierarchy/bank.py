"""Unary scores of many models at once: the cost of a page when each zone takes its cheapest label alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import RELATION_OFFSETS, LayoutGraph
from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES, Values
from services.layout.model.compiled_model import CompiledModel, comparable_scales
from services.layout.model.cost import COLUMNS_BY_COST, content_cost, relation_weight

Floats = NDArray[np.float32]
"""Single precision is enough to rank models, and its logarithms take a fifth of the time."""

MOST_ENTRIES = 4_000_000
"""Of the terms of nodes (4 bytes each), and of the pairs' descriptors, that are in memory at once; larger pages are
seen in parts."""


@dataclass(frozen=True, slots=True, eq=False)
class UnaryScores:
    """Costs of a page under M models, each zone having the label of least unary cost (pairs do not choose labels).

    `costs` (M,) by each model's own weights, `comparable` (M,) by the usual ones. Both are those of a labelling that
    matching may start from, pairs and counts included, and thus upper bounds of the least costs, but for words: they
    tell labels of one class apart, and have no part in the ranking of classes.
    """

    costs: NDArray[np.float64]
    comparable: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class _Weights:
    """Weights of K nodes and M models by one set of scales.

    Of nodes: `numeric` (K, A), `linear` (K, 2 C), `own` (K,). Of models: `relations` (M, R) and `counts` (M,).
    """

    numeric: Floats
    linear: Floats
    own: Floats
    relations: NDArray[np.float64]
    counts: NDArray[np.float64]


class ModelBank:
    """The nodes and look-up tables of M models in one array each."""

    def __init__(self, models: Sequence[CompiledModel], content_names: Sequence[str]) -> None:
        """`content_names` are the features that the models were compiled for; M >= 1."""
        self.sizes = np.array([len(model.labels) for model in models])
        self._starts = np.cumsum(self.sizes) - self.sizes
        self._model = np.repeat(np.arange(len(models)), self.sizes)
        values = np.concatenate([model.values for model in models])
        known = np.isfinite(values)
        self._values = np.where(known, values, 0.0).astype(np.float32)
        self._variances = np.concatenate([model.variances for model in models]).astype(np.float32)
        content = np.concatenate([model.content for model in models])
        label_costs = np.concatenate([model.label_costs for model in models])
        usual = np.tile(comparable_scales(content_names), (len(models), 1))
        own = np.stack([model.scales for model in models])
        learned = np.concatenate([model.weights for model in models])
        self._own, self._usual = (
            self._weigh(scales, learned, known, content, label_costs) for scales in (own, usual)
        )
        # Row u L + l of a model's part has the costs of all descriptors for the labels u and l.
        self._pair_starts = np.cumsum(self.sizes**2) - self.sizes**2
        self._relations = np.concatenate(
            [model.relations.reshape(-1, RELATION_OFFSETS[-1]) for model in models]
        ).astype(np.float32)
        most = max(model.counts.shape[1] for model in models)
        self._counts = np.concatenate(
            [
                np.pad(model.counts, ((0, 0), (0, most - model.counts.shape[1])), mode="edge")
                for model in models
            ]
        )

    def _weigh(
        self,
        scales: NDArray[np.float64],
        learned: NDArray[np.float64],
        known: NDArray[np.bool_],
        content: NDArray[np.float64],
        label_costs: NDArray[np.float64],
    ) -> _Weights:
        attributes, features = len(NUMERIC_ATTRIBUTES), content.shape[1]
        of_nodes = scales[self._model]
        of_nodes[:, : attributes + features] *= learned[:, : attributes + features]
        # The cost of content is linear in the confidence, so one matrix product gives it for all zones.
        weights = of_nodes[:, attributes : attributes + features]
        absent = np.nan_to_num(content_cost(np.zeros(1), content)) * weights
        present = np.nan_to_num(content_cost(np.ones(1), content)) * weights
        return _Weights(
            numeric=(of_nodes[:, :attributes] * known).astype(np.float32),
            linear=np.hstack([present - absent, absent]).astype(np.float32),
            own=(label_costs * of_nodes[:, learned.shape[1]]).astype(np.float32),
            relations=scales[:, -1 - len(RELATIONS) : -1],
            counts=scales[:, -1],
        )

    def unary_scores(self, graph: LayoutGraph) -> UnaryScores:
        """Scores of a page for all models; its graph has the content features that the bank was made with."""
        models = np.arange(len(self.sizes))
        labels = np.empty((graph.zones, len(models)), np.intp)
        node = np.zeros((2, len(models)))
        step = max(1, MOST_ENTRIES // self._values.size)
        for first in range(0, graph.zones, step):
            part = slice(first, first + step)
            own, usual = self._node_costs(graph, part)
            labels[part] = self._cheapest(own)
            nodes = self._starts + labels[part]
            for row, costs in enumerate((own, usual)):
                node[row] += np.take_along_axis(costs, nodes, axis=1).sum(axis=0, dtype=np.float64)
        counted = np.bincount((self._starts + labels).ravel(), minlength=len(self._model))
        of_labels = self._counts[np.arange(len(self._model)), np.minimum(counted, self._counts.shape[1] - 1)]
        count = np.add.reduceat(of_labels, self._starts)
        edge = self._edge_costs(graph, labels)
        total = [
            node[row] + (edge * weights.relations).sum(axis=1) + count * weights.counts
            for row, weights in enumerate((self._own, self._usual))
        ]
        return UnaryScores(*total)

    def _node_costs(self, graph: LayoutGraph, part: slice) -> tuple[Floats, Floats]:
        """Weighted costs (n, K) of giving zones the nodes' labels, by the models' own weights and by the usual ones."""
        measured = graph.numeric[part]
        known = np.isfinite(measured)
        values = cast("Values", np.where(known, measured, 0.0).astype(np.float32))
        expected, spread = cast("Values", self._values), cast("Values", self._variances)
        terms = np.empty((len(measured), *self._values.shape), np.float32)
        for cost, columns, means, variances in COLUMNS_BY_COST:
            terms[:, :, columns] = cost(values[:, None, columns], expected[:, columns], spread[:, columns])
            terms[:, :, columns] -= cost(values[:, columns], means, variances)[:, None]
        if not known.all():
            terms *= known[:, None]
        content = graph.content[part]
        read = np.isfinite(content)
        linear = np.hstack([np.where(read, content, 0.0), read]).astype(np.float32)
        own, usual = (
            np.einsum("nka,ka->nk", terms, weights.numeric) + linear @ weights.linear.T + weights.own
            for weights in (self._own, self._usual)
        )
        return own, usual

    def _cheapest(self, costs: Floats) -> NDArray[np.intp]:
        """The label (n, M) that each zone would have by each model."""
        padded = np.full((len(costs), len(self.sizes), self.sizes.max()), np.inf, np.float32)
        padded[:, self._model, np.arange(len(self._model)) - self._starts[self._model]] = costs
        return np.asarray(padded.argmin(axis=2), np.intp)

    def _edge_costs(self, graph: LayoutGraph, labels: NDArray[np.intp]) -> NDArray[np.float64]:
        """Unweighted costs (M, R) of all pairs together."""
        total = np.zeros((len(self.sizes), len(RELATIONS)))
        flat, width = self._relations.reshape(-1), self._relations.shape[1]
        descriptors = graph.relations + RELATION_OFFSETS[:-1]
        step = max(1, MOST_ENTRIES // len(self.sizes))
        for first in range(0, len(graph.pairs), step):
            upper, lower = graph.pairs[first : first + step].T
            rows = (self._pair_starts + labels[upper] * self.sizes + labels[lower]) * width
            for relation in range(len(RELATIONS)):
                chosen = rows + descriptors[first : first + step, relation, None]
                total[:, relation] += flat[chosen].sum(axis=0, dtype=np.float64)
        return total * relation_weight(graph.zones)
