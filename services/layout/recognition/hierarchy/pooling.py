"""The model of a genre: the mixture of its publications' models (5.7)."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.zone_words import WORD_ASPECTS
from services.layout.model.compiled_model import SUREST, CompiledModel
from services.layout.model.layout_model import MOST_LABELS, LayoutModel
from services.layout.model.word_counts import no_words

LEAST_ZONES = 0.05
"""Zones a page that a node counts as at least: one that no sample showed still says something."""

LARGEST_COST = 20.0
"""Costs are probabilities again when they are pooled; those of models from elsewhere may be of any size."""


def pool_models(models: Sequence[LayoutModel], compiled: Sequence[CompiledModel]) -> CompiledModel:
    """One model of several: nodes of the same label become their mixture, by zones a page.

    Means and variances are those of the mixture, so that what differs between publications has a wide spread here.
    Look-up tables are means of probabilities. A label that a model lacks is absent from its pages. At most
    `MOST_LABELS` labels are kept, those of most zones.
    """
    labels = _labels(models)
    index = {label: position for position, label in enumerate(labels)}
    pooled = _Sums(len(labels), compiled)
    for model, arrays in zip(models, compiled, strict=True):
        kept = [row for row, label in enumerate(arrays.labels) if label in index]
        rows = np.array([index[arrays.labels[row]] for row in kept], np.intp)
        zones = np.array([node.zones for node in model.nodes]) / max(1, model.samples) + LEAST_ZONES
        pooled.add(rows, np.array(kept, np.intp), zones, arrays)
    return pooled.model(labels, np.mean([arrays.scales for arrays in compiled], axis=0))


def _labels(models: Sequence[LayoutModel]) -> tuple[str | None, ...]:
    zones: defaultdict[str, float] = defaultdict(float)
    for model in models:
        for node in model.nodes:
            if node.label is not None:
                zones[node.label] += node.zones / max(1, model.samples) + LEAST_ZONES
    frequent = sorted(zones, key=lambda label: (-zones[label], label))[:MOST_LABELS]
    return (None, *sorted(frequent))


def _probabilities(costs: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.exp(-np.clip(costs, -LARGEST_COST, LARGEST_COST))


class _Sums:
    """Sums over models for L labels, weighted by zones."""

    def __init__(self, labels: int, compiled: Sequence[CompiledModel]) -> None:
        first = compiled[0]
        most = max(arrays.counts.shape[1] for arrays in compiled)
        self._models = len(compiled)
        self._known, self._totals, self._squares = np.zeros((3, labels, first.values.shape[1]))
        self._read, self._content = np.zeros((2, labels, first.content.shape[1]))
        self._label = np.zeros(labels)
        self._pairs = np.zeros((labels, labels, 1))
        self._relations = np.zeros((labels, labels, first.relations.shape[2]))
        self._counts = np.zeros((labels, most))
        self._absent = np.full(labels, float(len(compiled)))

    def add(
        self,
        rows: NDArray[np.intp],
        kept: NDArray[np.intp],
        zones: NDArray[np.float64],
        arrays: CompiledModel,
    ) -> None:
        """Nodes `kept` of a model, whose labels are the `rows` here."""
        zones = zones[kept]
        values, content = arrays.values[kept], arrays.content[kept]
        known, read = np.isfinite(values), np.isfinite(content)
        values = np.where(known, values, 0.0)
        self._known[rows] += zones[:, None] * known
        self._totals[rows] += zones[:, None] * values
        self._squares[rows] += zones[:, None] * np.where(known, values**2 + arrays.variances[kept], 0.0)
        self._read[rows] += zones[:, None] * read
        self._content[rows] += zones[:, None] * np.where(read, content, 0.0)
        self._label[rows] += _probabilities(arrays.label_costs[kept])
        weights = (zones[:, None] * zones)[:, :, None]
        here, there = np.ix_(rows, rows), np.ix_(kept, kept)
        self._pairs[here] += weights
        self._relations[here] += weights * _probabilities(arrays.relations[there])
        counts = arrays.counts[kept]
        missing = self._counts.shape[1] - counts.shape[1]
        self._counts[rows] += _probabilities(np.pad(counts, ((0, 0), (0, missing)), mode="edge"))
        self._absent[rows] -= 1

    def model(self, labels: tuple[str | None, ...], scales: NDArray[np.float64]) -> CompiledModel:
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = self._totals / self._known
            variance = np.maximum(self._squares / self._known - mean**2, 1e-9)
            content = np.clip(self._content / self._read, SUREST, 1 - SUREST)
            relations = -np.log(self._relations / self._pairs)
        counts = self._counts.copy()
        counts[:, 0] += self._absent
        return CompiledModel(
            labels=labels,
            values=np.where(self._known > 0, mean, np.nan),
            variances=np.where(self._known > 0, variance, 1.0),
            content=np.where(self._read > 0, content, np.nan),
            words=no_words(len(labels)),
            weights=np.ones((len(labels), mean.shape[1] + content.shape[1] + len(WORD_ASPECTS))),
            label_costs=-np.log(np.maximum(self._label, np.exp(-LARGEST_COST)) / self._models),
            relations=np.where(self._pairs > 0, relations, 0.0),
            counts=-np.log(np.maximum(counts / self._models, np.exp(-LARGEST_COST))),
            scales=scales,
        )
