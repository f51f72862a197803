"""The dissertation's adaptive update (5.5, 5.6.2): attributes and weights of incorrectly matched nodes move.

Let h be the wrong labelling and h* the right one. For every node that they match differently, D of an attribute is its
cost for h* minus its cost for h. An attribute that favours the wrong labelling (D > 0) is unreliable: its typical value
moves towards the right zones and its weight falls. One that favours the right labelling (D < 0) gets more weight.
Either way the sum of D over attributes, which is C(h*) - C(h), becomes smaller: C'(h*) - C'(h) < C(h*) - C(h).
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import RELATION_OFFSETS, LayoutGraph
from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES
from services.layout.learning.slopes import cost_slopes
from services.layout.model.compiled_model import SUREST, CompiledModel
from services.layout.model.cost import node_terms

_RATE = 0.1
"""Share by which values move and weights change, and units by which costs of look-up tables do."""
_MOST = 100.0
"""Largest weight, and largest cost of a descriptor, after repeated increases."""
_HALVINGS = 4
"""Number of halvings of a step that does not reduce D."""


Array = NDArray[np.float64]


def correct_errors(
    model: CompiledModel, graph: LayoutGraph, truth: NDArray[np.intp], found: NDArray[np.intp]
) -> CompiledModel:
    """The model after one update for a page with true labels h* = `truth` (N,) that were `found` (N,) to be h.

    C(h*) - C(h) is less under the new model wherever the two differ.
    """

    if np.array_equal(truth, found):
        return model
    side = _sides(truth, found, len(model.labels))
    model = _move_expectations(model, graph, side)
    favour = _favour(model, graph, side)
    factor = np.where(favour > 0, 1 - _RATE, np.where(favour < 0, 1 + _RATE, 1.0))
    slopes = cost_slopes(graph, model, truth) - cost_slopes(graph, model, found)
    return replace(
        model,
        weights=np.minimum(model.weights * factor, np.maximum(model.weights, _MOST)),
        label_costs=model.label_costs - _RATE * np.sign(slopes.label_costs),
        relations=_correct_tables(model.relations, slopes.relations),
        counts=model.counts - _RATE * np.sign(slopes.counts),
    )


def _sides(truth: NDArray[np.intp], found: NDArray[np.intp], labels: int) -> Array:
    """(N, L): 1 where the right labelling alone gives a zone the label, -1 where the wrong one alone does."""
    rows = np.flatnonzero(truth != found)
    side = np.zeros((len(truth), labels))
    side[rows, truth[rows]] = 1.0
    side[rows, found[rows]] = -1.0
    return side


def _favour(model: CompiledModel, graph: LayoutGraph, side: Array) -> Array:
    """D (L, A + C + W) of every attribute of every node: what it adds to C(h*) - C(h)."""
    nodes = len(model.scales) - len(RELATIONS) - 1
    terms = node_terms(graph, model) * model.scales[:nodes]
    return np.asarray(np.einsum("nl,nlk->lk", side, terms)[:, :-1])


def _move_expectations(model: CompiledModel, graph: LayoutGraph, side: Array) -> CompiledModel:
    """The model with typical values moved towards those of the right zones where D > 0; content as in 5.6.2.

    A step that does not reduce D is halved, at most `halvings` times, and then left out.
    """
    attributes = len(NUMERIC_ATTRIBUTES)
    favour = _favour(model, graph, side)
    right, wrong = side > 0, side < 0
    towards = _mean(right, graph.numeric) - model.values
    expected = _mean(right, graph.content) - _mean(wrong, graph.content)
    step = np.nan_to_num(np.hstack([np.where(favour[:, :attributes] > 0, towards, 0.0), expected]))
    rate = np.full(step.shape, _RATE)
    values, content = model.values, model.content
    for _ in range(_HALVINGS):
        moved = replace(
            model,
            values=model.values + (rate * step)[:, :attributes],
            content=np.clip(model.content + (rate * step)[:, attributes:], SUREST, 1 - SUREST),
        )
        better = (_favour(moved, graph, side) < favour)[:, : step.shape[1]]
        values = np.where(better[:, :attributes], moved.values, values)
        content = np.where(better[:, attributes:], moved.content, content)
        step = np.where(better, 0.0, step)
        rate /= 2
    return replace(model, values=values, content=content)


def _mean(member: NDArray[np.bool_], values: Array) -> Array:
    """Mean (L, K) of the known values (N, K) of each node's zones (N, L), NaN where there are none."""
    known = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        return np.asarray((member.T @ np.where(known, values, 0.0)) / (member.T.astype(np.float64) @ known))


def _correct_tables(relations: Array, slopes: Array) -> Array:
    """Look-up tables: more weight to those that favour the right labelling, else its descriptors become cheaper."""
    corrected, rate = relations.copy(), _RATE
    most = np.maximum(np.abs(relations), _MOST)
    for start, end in pairwise(RELATION_OFFSETS):
        table, slope = relations[:, :, start:end], slopes[:, :, start:end]
        favours_right = ((table * slope).sum(axis=2) < 0)[:, :, None]
        corrected[:, :, start:end] = np.where(
            favours_right, table * (1 + rate), table - rate * np.sign(slope)
        )
    return np.clip(corrected, -most, most)
