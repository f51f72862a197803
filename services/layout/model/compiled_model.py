"""A layout graph model as arrays, in the order in which graphs have their attributes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.amount_features import AMOUNT_FEATURES
from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import KIND_FEATURES, RELATION_OFFSETS
from services.layout.graph.node_attributes import APPEARANCE_ATTRIBUTES, NUMERIC_ATTRIBUTES
from services.layout.graph.section_features import SECTION_FEATURES
from services.layout.graph.zone_words import WORD_ASPECTS
from services.layout.model.layout_model import LayoutModel, ModelNode
from services.layout.model.word_counts import WordCounts, no_words

CONTENT_SCALE = 0.6
KIND_SCALE = 2.0
LABEL_SCALE = 0.4
COUNT_SCALE = 0.4
WORD_SCALE = 0.2
"""Default weights without enough samples: of a content feature, of a kind of zone as a feature, of a label's own cost,
of its count, of an aspect of a zone's words."""

SUREST = 0.001
"""Expectation values are clipped to this distance from 0 and 1, so that no cost is infinite."""

LABEL, COUNT = "label", "count"
"""Names of the last two of a model's scales."""


def content_scale_name(feature: str) -> str:
    """Name of a content feature's weight in a model's scales."""
    return f"content:{feature}"


@dataclass(frozen=True, slots=True, eq=False)
class CompiledModel:
    """Arrays of a model with L nodes for A numeric attributes, C content features and D descriptors.

    `values`, `variances` (L, A), NaN where the model has none; `content` (L, C) expectation values, NaN likewise;
    `words` what zones say, in W aspects; `weights` (L, A + C + W) of all three, beside their scales; `label_costs`
    (L,); `relations` (L, L, D) costs of descriptors by upper and lower label; `counts` (L, M) costs of 0 .. M - 1
    zones. `scales` weigh A numeric attributes, C features, W aspects of words, the label's own cost, R relations, and
    the counts, in this order.
    """

    labels: tuple[str | None, ...]
    values: NDArray[np.float64]
    variances: NDArray[np.float64]
    content: NDArray[np.float64]
    words: WordCounts
    weights: NDArray[np.float64]
    label_costs: NDArray[np.float64]
    relations: NDArray[np.float64]
    counts: NDArray[np.float64]
    scales: NDArray[np.float64]


def scale_names(content_names: Sequence[str]) -> tuple[str, ...]:
    """Names of the scales in the order of `CompiledModel.scales`."""
    return (
        *(attribute.name for attribute in NUMERIC_ATTRIBUTES),
        *(content_scale_name(name) for name in content_names),
        *WORD_ASPECTS,
        LABEL,
        *(relation.name for relation in RELATIONS),
        COUNT,
    )


def default_scales(content_names: Sequence[str]) -> NDArray[np.float64]:
    """The default weights without samples, in the order of `scale_names`."""
    return np.array(
        [
            *(attribute.scale for attribute in NUMERIC_ATTRIBUTES),
            *(KIND_SCALE if name in KIND_FEATURES else CONTENT_SCALE for name in content_names),
            *(WORD_SCALE for _ in WORD_ASPECTS),
            LABEL_SCALE,
            *(relation.scale for relation in RELATIONS),
            COUNT_SCALE,
        ]
    )


def comparable_scales(content_names: Sequence[str]) -> NDArray[np.float64]:
    """The weights by which classes, and pages without labels, are compared: the default ones, without sections and
    appearance.

    Most zones of any publication lie under a title, so sections tell labels of one class apart, not classes. With them
    a page of a withheld class passed for another one more often (1.3 to 2.5 % of 308 pages). Appearance is unknown
    where no image was sent, and pages with and without it are compared with one mean cost of the class.
    """
    names = scale_names(content_names)
    derived = (*SECTION_FEATURES, *AMOUNT_FEATURES)
    left_out = [*map(content_scale_name, derived), *APPEARANCE_ATTRIBUTES, *WORD_ASPECTS]
    return np.where(np.isin(names, left_out), 0.0, default_scales(content_names))


_COMPILED: WeakKeyDictionary[LayoutModel, tuple[tuple[str, ...], CompiledModel]] = WeakKeyDictionary()
"""Arrays of the models in use, for the content features of their last use."""


def compile_model(model: LayoutModel, content_names: Sequence[str]) -> CompiledModel:
    """Arrays of `model`, the same ones while it is in use: nobody changes them.

    Attributes that it does not have cost nothing; its unknown attributes are left out.
    """
    names = tuple(content_names)
    kept = _COMPILED.get(model)
    if kept is None or kept[0] != names:
        kept = _COMPILED[model] = names, _compile(model, names)
    return kept[1]


def _compile(model: LayoutModel, content_names: Sequence[str]) -> CompiledModel:
    nodes, count = model.nodes, len(model.nodes)
    values = np.full((count, len(NUMERIC_ATTRIBUTES)), np.nan)
    variances, weights = np.ones_like(values), np.ones_like(values)
    for row, node in enumerate(nodes):
        for column, attribute in enumerate(NUMERIC_ATTRIBUTES):
            expected = node.numeric.get(attribute.name)
            if expected is not None:
                values[row, column], variances[row, column] = expected.value, expected.variance
                weights[row, column] = expected.weight
    content, content_weights = (
        np.array(
            [[given.get(name, default) for name in names] for given in by_node], dtype=np.float64
        ).reshape(count, len(names))
        for by_node, names, default in (
            ([node.content for node in nodes], tuple(content_names), np.nan),
            ([node.content_weights for node in nodes], (*content_names, *WORD_ASPECTS), 1.0),
        )
    )
    index = {node.label: position for position, node in enumerate(nodes)}
    relations = np.zeros((count, count, RELATION_OFFSETS[-1]))
    for edge in model.edges:
        row = relations[index[edge.upper], index[edge.lower]]
        for position, relation in enumerate(RELATIONS):
            costs = edge.costs.get(relation.name)
            if costs is not None and len(costs) == len(relation.descriptors):
                row[RELATION_OFFSETS[position] : RELATION_OFFSETS[position + 1]] = costs
    most = max(len(node.count_costs) for node in nodes)
    counts = np.array(
        [node.count_costs + (node.count_costs[-1],) * (most - len(node.count_costs)) for node in nodes]
    )
    return CompiledModel(
        labels=model.labels,
        values=values,
        variances=variances,
        content=np.clip(content, SUREST, 1 - SUREST),
        words=_words(nodes),
        weights=np.hstack([weights, content_weights]),
        label_costs=np.array([node.cost for node in nodes]),
        relations=relations,
        counts=counts,
        scales=_scales(model.scales, content_names),
    )


def _words(nodes: Sequence[ModelNode]) -> WordCounts:
    words = no_words(len(nodes))
    counts: dict[tuple[int, str], NDArray[np.float64]] = {}
    for row, node in enumerate(nodes):
        for aspect, name in enumerate(WORD_ASPECTS):
            said = node.words.get(name)
            if said is None:
                continue
            words.zones[row, aspect] = said.zones
            for text, zones in said.tokens.items():
                counts.setdefault((aspect, text), np.zeros(len(nodes)))[row] = zones
    return WordCounts(words.zones, counts)


def _scales(given: Mapping[str, float], content_names: Sequence[str]) -> NDArray[np.float64]:
    names = scale_names(content_names)
    usual = default_scales(content_names)
    return np.array([given.get(name, default) for name, default in zip(names, usual, strict=True)])
