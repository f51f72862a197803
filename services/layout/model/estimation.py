"""From the statistics of a class to its model (5.6.1): means, weights, look-up tables, expectations."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import RELATION_OFFSETS
from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES
from services.layout.graph.zone_words import WORD_ASPECTS
from services.layout.model.compiled_model import CompiledModel, scale_names
from services.layout.model.layout_model import (
    LARGEST,
    MOST_BIAS,
    MOST_WEIGHT,
    Calibration,
    LayoutModel,
    ModelEdge,
    ModelNode,
    ModelStatistics,
    NodeWords,
    NumericExpectation,
    PieceStatistics,
)
from services.layout.model.statistics import MOST_COUNTED, LabelStatistics
from services.layout.model.word_counts import LEAST_ZONES, MOST_KEPT, WordCounts, dearest_tokens

_USUAL_WEIGHT = 2.0
"""Of an attribute's usual spread within a component, against the variance seen, and of a descriptor's frequency over
all pairs, against that of the pair of components."""
CONTENT_RANGE = (0.003, 0.997)
"""Range of expectation values: a feature that never occurred may still occur."""
_COUNT_WEIGHT = 0.5
"""Added to every component's number of zones, as by Jeffreys' prior, and weight of the usual numbers of zones of one
on a page: none as often as any, one as often as all more."""


def estimate_model(
    statistics: LabelStatistics, labels: Sequence[str | None], scales: NDArray[np.float64]
) -> CompiledModel:
    """Means, variances, look-up tables and expectations of `statistics` over pages with `labels`."""

    values, variances = _estimate_numeric(statistics)
    return CompiledModel(
        labels=tuple(labels),
        values=values,
        variances=variances,
        content=_estimate_content(statistics),
        words=statistics.words,
        weights=np.ones((len(labels), values.shape[1] + statistics.content.shape[1] + len(WORD_ASPECTS))),
        label_costs=-np.log(
            (statistics.zones + _COUNT_WEIGHT) / (statistics.zones.sum() + _COUNT_WEIGHT * len(labels))
        ),
        relations=_estimate_relations(statistics),
        counts=_estimate_counts(statistics),
        scales=scales,
    )


def _estimate_numeric(statistics: LabelStatistics) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Means (L, A), NaN where no value is known, and variances of the next value.

    The variance seen is drawn to the attribute's usual one; the mean's own uncertainty is added.
    """
    known = statistics.known
    usual = np.array([attribute.spread**2 for attribute in NUMERIC_ATTRIBUTES])
    with np.errstate(all="ignore"):
        mean = statistics.totals / known
        seen = np.maximum(statistics.squares / known - mean**2, 0.0)
        weight = _USUAL_WEIGHT
        variance = (known * seen + weight * usual) / (known + weight) * (1 + 1 / known)
    return np.where(known > 0, mean, np.nan), np.where(known > 0, variance, 1.0)


def _estimate_content(statistics: LabelStatistics) -> NDArray[np.float64]:
    read = statistics.read
    overall = (statistics.content.sum(axis=0) + 0.05) / (read.sum(axis=0) + 0.5)
    # As if one more zone had been seen, with the frequency of all.
    expected = (statistics.content + overall) / (read + 1.0)
    return np.where(read > 0, np.clip(expected, *CONTENT_RANGE), np.nan)


def _estimate_relations(statistics: LabelStatistics) -> NDArray[np.float64]:
    costs = np.empty_like(statistics.descriptors)
    for relation, start in zip(RELATIONS, RELATION_OFFSETS[:-1], strict=True):
        columns = slice(start, start + len(relation.descriptors))
        seen = statistics.descriptors[:, :, columns]
        overall = seen.sum(axis=(0, 1)) + 1.0
        overall /= overall.sum()
        weight = _USUAL_WEIGHT
        pairs = seen.sum(axis=2, keepdims=True)
        costs[:, :, columns] = -np.log((seen + weight * overall) / (pairs + weight) / overall)
    return costs


def _estimate_counts(statistics: LabelStatistics) -> NDArray[np.float64]:
    usual = np.full(MOST_COUNTED + 1, 0.25 / (MOST_COUNTED - 1))
    usual[:2] = 0.5, 0.25
    weight = _COUNT_WEIGHT
    return np.asarray(-np.log((statistics.counts + weight * usual) / (statistics.pages + weight)))


def name_parts(
    model: CompiledModel,
    name: str,
    samples: int,
    zones: Sequence[float],
    content_names: Sequence[str],
    calibration: Calibration,
    statistics: ModelStatistics | None,
    pieces: Mapping[str, PieceStatistics],
) -> LayoutModel:
    """The model as it is stored, its arrays as mappings by name, rounded and clipped to the limits of a model."""
    values, variances = _stored(model.values, 5).tolist(), _stored(model.variances, 8).tolist()
    known = np.isfinite(model.values).tolist()
    weights = _stored(np.minimum(model.weights, MOST_WEIGHT), 4)
    numeric_weights, content_weights = (
        part.tolist() for part in np.split(weights, [len(NUMERIC_ATTRIBUTES)], axis=1)
    )
    content, counts = np.round(model.content, 4).tolist(), _stored(model.counts, 3).tolist()
    relations, has_costs = _stored(model.relations, 3).tolist(), np.any(model.relations, axis=2).tolist()
    words = _name_words(model.words)
    label_costs, scales = _stored(model.label_costs, 4), _stored(np.minimum(model.scales, MOST_WEIGHT), 4)
    return LayoutModel(
        name=name,
        samples=min(samples, int(LARGEST)),
        nodes=tuple(
            ModelNode(
                label=label,
                zones=min(float(zones[row]), LARGEST),
                cost=float(label_costs[row]),
                numeric={
                    attribute.name: NumericExpectation(
                        values[row][column],
                        max(variances[row][column], 1e-8),
                        numeric_weights[row][column],
                    )
                    for column, attribute in enumerate(NUMERIC_ATTRIBUTES)
                    if known[row][column]
                },
                content={
                    feature: expected
                    for feature, expected in zip(content_names, content[row], strict=True)
                    if isfinite(expected)
                },
                count_costs=tuple(counts[row]),
                content_weights={
                    feature: weight
                    for feature, weight in zip(
                        (*content_names, *WORD_ASPECTS), content_weights[row], strict=True
                    )
                    if weight != 1.0
                },
                pieces=pieces.get(label or "", PieceStatistics()),
                words=words[row],
            )
            for row, label in enumerate(model.labels)
        ),
        edges=tuple(
            ModelEdge(upper, lower, _name_costs(relations[row][column]))
            for row, upper in enumerate(model.labels)
            for column, lower in enumerate(model.labels)
            if has_costs[row][column]
        ),
        scales=dict(zip(scale_names(content_names), scales.tolist(), strict=True)),
        calibration=replace(
            calibration,
            mean=min(max(calibration.mean, -LARGEST), LARGEST),
            deviation=min(calibration.deviation, LARGEST),
            pages=min(calibration.pages, int(LARGEST)),
            bias=min(max(calibration.bias, -MOST_BIAS), MOST_BIAS),
        ),
        statistics=statistics,
    )


def _name_words(words: WordCounts) -> list[dict[str, NodeWords]]:
    """Of each node its tokens by aspect; aspects without zones are left out."""
    kept: list[list[dict[str, float]]] = [[{} for _ in WORD_ASPECTS] for _ in words.zones]
    for aspect, text in dearest_tokens(words, MOST_KEPT):
        zones = words.counts[aspect, text]
        for row in np.flatnonzero(zones >= LEAST_ZONES).tolist():
            kept[row][aspect][text] = round(min(float(zones[row]), LARGEST), 4)
    return [
        {
            name: NodeWords(round(min(float(zones), LARGEST), 4), tokens)
            for name, zones, tokens in zip(WORD_ASPECTS, own, kept[row], strict=True)
            if zones >= LEAST_ZONES
        }
        for row, own in enumerate(words.zones)
    ]


def _stored(numbers: NDArray[np.float64], digits: int) -> NDArray[np.float64]:
    return np.asarray(np.round(np.clip(numbers, -LARGEST, LARGEST), digits), np.float64)


def _name_costs(row: Sequence[float]) -> dict[str, tuple[float, ...]]:
    return {
        relation.name: tuple(row[start : start + len(relation.descriptors)])
        for relation, start in zip(RELATIONS, RELATION_OFFSETS[:-1], strict=True)
    }
