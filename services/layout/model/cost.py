"""The cost of a match between a model and a page (Equation 5.1), term by term and as tables for matching."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import RELATION_OFFSETS, LayoutGraph
from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES, CostFunction
from services.layout.graph.zone_words import WORD_ASPECTS
from services.layout.matching.cost_tables import CostTables
from services.layout.model.compiled_model import LABEL, CompiledModel, content_scale_name
from services.layout.model.word_counts import word_costs

USUAL_CONTENT = 0.1
"""Mean confidence of a content feature in zones of any page; costs are relative to it."""

MOST_EXPLAINED = 1000
"""Terms of a cost in an explanation; a page of 500 zones has 200 000."""


@dataclass(frozen=True, slots=True)
class AttributeCost:
    """One term of the cost: of a zone (`other` None) or of a pair of zones, by one attribute."""

    zone: str
    other: str | None
    attribute: str
    cost: float


def _columns_by_cost() -> Iterator[tuple[CostFunction, list[int], NDArray[np.float64], NDArray[np.float64]]]:
    """Attributes of each cost function, with means and variances of their backgrounds: one call does for all."""
    for cost in dict.fromkeys(attribute.cost for attribute in NUMERIC_ATTRIBUTES):
        columns = [k for k, attribute in enumerate(NUMERIC_ATTRIBUTES) if attribute.cost is cost]
        background = np.array([NUMERIC_ATTRIBUTES[k].background for k in columns])
        yield cost, columns, background[:, 0], background[:, 1] ** 2


COLUMNS_BY_COST = tuple(_columns_by_cost())
"""(cost function, its attributes' columns, their backgrounds' means and variances)."""
_RELATION_OF_DESCRIPTOR = np.repeat(np.arange(len(RELATIONS)), np.diff(RELATION_OFFSETS))


def node_terms(graph: LayoutGraph, model: CompiledModel) -> NDArray[np.float64]:
    """Costs (N, L, A + C + W + 1) of giving zone z label l, attribute by attribute, not yet weighted by scales.

    Each is relative to a zone of any page, so that 0 means that the attribute says nothing for or against the
    label: numeric attributes, content features, aspects of words, and the label's own cost. What is unknown of the
    zone or in the model costs 0.
    """
    return _node_terms(graph, model, np.arange(len(model.labels))[None])


def _node_terms(graph: LayoutGraph, model: CompiledModel, labels: NDArray[np.intp]) -> NDArray[np.float64]:
    """Terms (N, K, A + C + W + 1) of `labels` (N, K), or of (1, K) for all zones; see `node_terms`."""
    attributes = len(NUMERIC_ATTRIBUTES)
    features = attributes + len(graph.content_names)
    terms = np.zeros((graph.zones, labels.shape[1], model.weights.shape[1] + 1))
    with np.errstate(invalid="ignore"):
        for cost, columns, means, variances in COLUMNS_BY_COST:
            values = graph.numeric[:, None, columns]
            expected, spread = model.values[:, columns][labels], model.variances[:, columns][labels]
            terms[:, :, columns] = cost(values, expected, spread) - cost(values, means, variances)
        terms[:, :, attributes:features] = content_cost(graph.content[:, None, :], model.content[labels])
        if graph.tokens.tokens and model.words.counts:
            words = word_costs(graph.tokens, graph.zones, model.words)
            terms[:, :, features:-1] = np.take_along_axis(words, labels[:, :, None], axis=1)
        terms[:, :, :-1] *= model.weights[labels]
    terms[:, :, -1] = model.label_costs[labels]
    return np.nan_to_num(terms, copy=False, nan=0.0)


def content_cost(confidence: NDArray[np.float64], expectation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Equation 5.3 with the log likelihoods of its two mismatches as their costs.

    So a feature that never occurs in a component costs more than a rare one. As in 5.3 the cost is linear in the
    confidence; it falls with it for an expectation above the usual one and rises below it. On title pages and letters
    this gives fewer errors than 5.3 at any number of samples.
    """
    present = np.log(expectation / USUAL_CONTENT)
    absent = np.log((1 - expectation) / (1 - USUAL_CONTENT))
    return np.asarray(-(confidence * present + (1 - confidence) * absent))


def relation_weight(zones: int) -> float:
    """Share with which each of a zone's edges counts on a page of `zones` zones.

    Each node has N - 1 edges with correlated information. With this weight their sum grows like a sum of independent
    errors.
    """
    return float(1 / np.sqrt(max(1, zones - 1)))


def build_cost_tables(graph: LayoutGraph, model: CompiledModel) -> CostTables:
    """Tables of all costs of matching `graph` with `model`; label k is the model's node k."""
    labels, nodes = len(model.labels), model.weights.shape[1] + 1
    node = node_terms(graph, model) @ model.scales[:nodes]
    weights = model.scales[nodes:-1][_RELATION_OF_DESCRIPTOR] * relation_weight(graph.zones)
    by_descriptor = (model.relations * weights).reshape(labels * labels, -1)
    edge = (graph.descriptor_indicators() @ by_descriptor.T).reshape(-1, labels, labels)
    flipped = graph.pairs[:, 0] > graph.pairs[:, 1]
    edge[flipped] = edge[flipped].transpose(0, 2, 1)
    counted = np.minimum(np.arange(graph.zones + 1), model.counts.shape[1] - 1)
    return CostTables(
        node=node,
        pairs=np.sort(graph.pairs, axis=1),
        edge=edge,
        count=model.scales[-1] * model.counts[:, counted],
    )


def labelling_cost(
    graph: LayoutGraph, model: CompiledModel, labels: NDArray[np.intp], scales: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Cost of nodes, edges and counts of one labelling (N,), weighted by `scales`."""
    node, edge = _chosen_terms(graph, model, labels, scales)
    counts = np.bincount(labels, minlength=len(model.labels))
    counted = model.counts[np.arange(len(model.labels)), np.minimum(counts, model.counts.shape[1] - 1)]
    return float(node.sum()), float(edge.sum()), float(scales[-1] * counted.sum())


def explain_cost(
    graph: LayoutGraph, model: CompiledModel, labels: NDArray[np.intp], zone_ids: Sequence[str]
) -> tuple[AttributeCost, ...]:
    """The weighted terms of a labelling's cost by zone or pair and attribute, largest size first.

    At most `MOST_EXPLAINED`, and none that are zero.
    """
    node, edge = _chosen_terms(graph, model, labels, model.scales)
    names = (
        *(attribute.name for attribute in NUMERIC_ATTRIBUTES),
        *(content_scale_name(name) for name in graph.content_names),
        *WORD_ASPECTS,
        LABEL,
    )
    size = np.concatenate([np.abs(node).ravel(), np.abs(edge).ravel()])
    largest = np.argsort(-size, kind="stable")[:MOST_EXPLAINED]
    kept_terms = []
    for index in largest[size[largest] > 0]:
        if index < node.size:
            zone, attribute = divmod(int(index), node.shape[1])
            term = AttributeCost(zone_ids[zone], None, names[attribute], float(node[zone, attribute]))
        else:
            pair, relation = divmod(int(index) - node.size, edge.shape[1])
            upper, lower = graph.pairs[pair]
            term = AttributeCost(
                zone_ids[upper], zone_ids[lower], RELATIONS[relation].name, float(edge[pair, relation])
            )
        kept_terms.append(term)
    return tuple(kept_terms)


def weighted_node_terms(
    graph: LayoutGraph, model: CompiledModel, labels: NDArray[np.intp], scales: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Terms (N, A + C + W + 1) of the nodes of one labelling (N,), weighted by `scales`."""
    nodes = len(scales) - len(RELATIONS) - 1
    return np.asarray(_node_terms(graph, model, labels[:, None])[:, 0] * scales[:nodes])


def _chosen_terms(
    graph: LayoutGraph, model: CompiledModel, labels: NDArray[np.intp], scales: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weighted terms of a labelling: of its nodes (N, A + C + W + 1), and of its edges (E, R)."""
    node = weighted_node_terms(graph, model, labels, scales)
    nodes = len(scales) - len(RELATIONS) - 1
    upper, lower = labels[graph.pairs.T]
    descriptors = graph.relations + RELATION_OFFSETS[:-1]
    edge = model.relations[upper[:, None], lower[:, None], descriptors] * scales[nodes:-1]
    return node, edge * relation_weight(graph.zones)
