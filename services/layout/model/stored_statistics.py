"""Sufficient statistics of a model: as they are stored (`ModelStatistics`), and as arrays (`LabelStatistics`)."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import RELATION_OFFSETS
from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES
from services.layout.model.compiled_model import CompiledModel, scale_names
from services.layout.model.layout_model import (
    LARGEST,
    LARGEST_SUM,
    EdgeStatistics,
    LayoutModel,
    ModelStatistics,
    NodeStatistics,
)
from services.layout.model.statistics import MOST_COUNTED, LabelStatistics

_DESCRIPTORS = tuple(
    f"{relation.name}:{descriptor}" for relation in RELATIONS for descriptor in relation.descriptors
)
_DIGITS = 6
"""Of sums, after the point: attributes are shares and logarithms."""
_LEAST = 10.0**-_DIGITS
"""Smaller numbers of zones count as 0: they are stored as 0, and a mean over them may be NaN."""


def store_statistics(
    statistics: LabelStatistics,
    labels: Sequence[str | None],
    content_names: Sequence[str],
    certainty: NDArray[np.float64],
) -> ModelStatistics:
    """The sums over pages with `labels` by name, none larger than a model may hold."""
    sums = [statistics.known, statistics.totals, statistics.squares]
    numeric = _stored(np.stack(sums, axis=2)).tolist()
    content = _stored(np.stack([statistics.read, statistics.content], axis=2)).tolist()
    zones, counts = _stored(statistics.zones).tolist(), _stored(statistics.counts).tolist()
    descriptors = _stored(statistics.descriptors).tolist()
    is_seen = np.any(statistics.descriptors, axis=2).tolist()
    return ModelStatistics(
        pages=min(float(statistics.pages[0]), LARGEST_SUM),
        descriptors=_DESCRIPTORS,
        nodes=tuple(
            NodeStatistics(
                zones=zones[row],
                numeric={
                    attribute.name: tuple(values)
                    for attribute, values in zip(NUMERIC_ATTRIBUTES, numeric[row], strict=True)
                    if values[0]
                },
                content={
                    name: tuple(values)
                    for name, values in zip(content_names, content[row], strict=True)
                    if values[0]
                },
                counts=tuple(counts[row]),
            )
            for row in range(len(labels))
        ),
        edges=tuple(
            EdgeStatistics(upper, lower, tuple(descriptors[row][column]))
            for row, upper in enumerate(labels)
            for column, lower in enumerate(labels)
            if is_seen[row][column]
        ),
        certainty={
            name: round(min(float(value), LARGEST), 4)
            for name, value in zip(scale_names(content_names), certainty, strict=True)
        },
    )


def restore_statistics(
    model: LayoutModel, compiled: CompiledModel, content_names: Sequence[str]
) -> tuple[LabelStatistics, NDArray[np.float64]]:
    """Sums over the pages that `model` was made of, and the certainty (K,) of its scales.

    A model that is stored without statistics gets those that its values suggest: as many zones as its nodes have, all
    with the typical values.
    """
    names = scale_names(content_names)
    if model.statistics is None:
        return _presume(model, compiled), np.zeros(len(names))
    stored, count = model.statistics, len(model.nodes)
    unseen, unread = (0.0, 0.0, 0.0), (0.0, 0.0)
    numeric = np.array(
        [[node.numeric.get(each.name, unseen) for each in NUMERIC_ATTRIBUTES] for node in stored.nodes]
    )
    content = np.array([[node.content.get(name, unread) for name in content_names] for node in stored.nodes])
    content = content.reshape(count, len(content_names), 2)
    counts = np.array([_of_length(node.counts, MOST_COUNTED + 1) for node in stored.nodes])
    numeric[numeric[:, :, 0] < _LEAST] = 0.0
    content[content[:, :, 0] < _LEAST] = 0.0
    index = {node.label: position for position, node in enumerate(model.nodes)}
    known = [column for column, name in enumerate(_DESCRIPTORS) if name in stored.descriptors]
    columns = [stored.descriptors.index(_DESCRIPTORS[column]) for column in known]
    descriptors = np.zeros((count, count, len(_DESCRIPTORS)))
    if stored.edges:
        seen = np.array([edge.seen for edge in stored.edges])[:, columns]
        ends = [[index[edge.upper], index[edge.lower]] for edge in stored.edges]
        upper, lower = np.array(ends).T
        descriptors[upper[:, None], lower[:, None], known] = seen
    statistics = LabelStatistics(
        zones=np.array([node.zones for node in stored.nodes]),
        known=numeric[:, :, 0],
        totals=numeric[:, :, 1],
        squares=numeric[:, :, 2],
        read=content[:, :, 0],
        content=content[:, :, 1],
        descriptors=descriptors,
        counts=counts,
        pages=np.array([stored.pages]),
        words=compiled.words,
    )
    return statistics, np.array([stored.certainty.get(name, 0.0) for name in names])


def with_nodes(statistics: LabelStatistics, count: int) -> LabelStatistics:
    """The sums for `count` labels, of which the last ones were never seen on the pages."""
    more = count - len(statistics.zones)
    last = np.zeros((more, MOST_COUNTED + 1))
    last[:, 0] = statistics.pages[0]

    def grown(sums: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.pad(sums, ((0, more), *((0, 0) for _ in sums.shape[1:])))

    return LabelStatistics(
        zones=grown(statistics.zones),
        known=grown(statistics.known),
        totals=grown(statistics.totals),
        squares=grown(statistics.squares),
        read=grown(statistics.read),
        content=grown(statistics.content),
        descriptors=np.pad(statistics.descriptors, ((0, more), (0, more), (0, 0))),
        counts=np.vstack([statistics.counts, last]),
        pages=statistics.pages,
        words=statistics.words.with_labels(count),
    )


def _presume(model: LayoutModel, compiled: CompiledModel) -> LabelStatistics:
    zones = np.array([node.zones for node in model.nodes])
    known = np.where(np.isfinite(compiled.values), zones[:, None], 0.0)
    values = np.nan_to_num(compiled.values)
    read = np.where(np.isfinite(compiled.content), zones[:, None], 0.0)
    counts = np.zeros((len(zones), MOST_COUNTED + 1))
    columns = min(compiled.counts.shape[1], MOST_COUNTED + 1)
    counts[:, :columns] = softmax(-compiled.counts, axis=1)[:, :columns] * model.samples
    pairs = np.outer(zones, zones) / (2 * max(1, model.samples))
    descriptors = np.empty_like(compiled.relations)
    for start, end in pairwise(RELATION_OFFSETS):
        descriptors[:, :, start:end] = (
            softmax(-compiled.relations[:, :, start:end], axis=2) * pairs[:, :, None]
        )
    return LabelStatistics(
        zones=zones,
        known=known,
        totals=known * values,
        squares=known * (values**2 + compiled.variances),
        read=read,
        content=read * np.nan_to_num(compiled.content),
        descriptors=descriptors,
        counts=counts,
        pages=np.array([float(model.samples)]),
        words=compiled.words,
    )


def _stored(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.round(np.clip(sums, -LARGEST_SUM, LARGEST_SUM), _DIGITS), np.float64)


def _of_length(row: Sequence[float], length: int) -> NDArray[np.float64]:
    """`row` with zeros behind it, or with its end summed up in the last place."""
    counts = np.zeros(length)
    np.add.at(counts, np.minimum(np.arange(len(row)), length - 1), row)
    return counts
