"""Differences between two versions of a layout graph model, largest difference first.

Each change concerns one number. Changes are sorted by their largest effect on the cost of a zone or of a pair of zones:
for look-up tables the difference of costs; for values the difference in standard deviations; for variances half the
difference of logarithms; for expectation values the difference of log odds. Each is multiplied by the weight of its
attribute. Numbers without an effect on costs (numbers of zones and samples) come last.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple, TypeVar

from services.contract.answers.learning import Change
from services.contract.layout import ModelDocument
from services.contract.layout_models import ModelDifference
from services.layout.graph.edge_attributes import RELATIONS
from services.layout.model.compiled_model import COUNT, LABEL, SUREST, content_scale_name
from services.layout.model.layout_model import LayoutModel, ModelEdge, ModelNode, NumericExpectation
from services.operations.stored_models import read_model

K = TypeVar("K")
V = TypeVar("V")

_DESCRIPTORS = {relation.name: relation.descriptors for relation in RELATIONS}


class SizedChange(NamedTuple):
    """One number that differs; `size` is the largest effect on the cost, infinite for an added or removed node."""

    size: float
    change: Change


def compare_models(old: ModelDocument, new: ModelDocument, most: int) -> ModelDifference:
    """The `most` largest changes from `old` to `new`, two versions of one model, and the number of all changes.

    Raises
    ------
    InvalidModel
        When this release cannot read one of them.
    """
    before, after = read_model(old), read_model(new)
    changes = [*_model_changes(before, after), *_node_changes(before, after), *_edge_changes(before, after)]
    changes.sort(key=lambda each: -each.size)
    return ModelDifference(len(changes), [each.change for each in changes[:most]])


def _model_changes(old: LayoutModel, new: LayoutModel) -> Iterator[SizedChange]:
    yield from _number("model", (), "samples", old.samples, new.samples, 0.0)
    a, b = old.calibration, new.calibration
    size = abs(b.mean - a.mean) / a.deviation
    yield from _number("model", (), "calibration:mean", a.mean, b.mean, size)
    size = abs(math.log(b.deviation / a.deviation))
    yield from _number("model", (), "calibration:deviation", a.deviation, b.deviation, size)
    yield from _number("model", (), "calibration:pages", a.pages, b.pages, 0.0)
    for name, was, became in _both(old.scales, new.scales):
        yield from _number("model", (), f"weight:{name}", was, became, _distance(was, became))


def _node_changes(old: LayoutModel, new: LayoutModel) -> Iterator[SizedChange]:
    nodes = _both({node.label: node for node in old.nodes}, {node.label: node for node in new.nodes})
    for label, was, became in nodes:
        if was is None or became is None:  # an added or removed node is one change
            sizes = (None if was is None else was.zones, None if became is None else became.zones)
            yield from _number("node", (label,), "zones", *sizes, math.inf)
        elif was != became:
            yield from _changes_of_node(was, became, old.scales)


def _changes_of_node(old: ModelNode, new: ModelNode, scales: Mapping[str, float]) -> Iterator[SizedChange]:
    labels = (old.label,)
    yield from _number("node", labels, "zones", old.zones, new.zones, 0.0)
    yield from _number(
        "node", labels, "cost", old.cost, new.cost, scales.get(LABEL, 1.0) * abs(new.cost - old.cost)
    )
    for name, a, b in _both(old.numeric, new.numeric):
        yield from _changes_of_expectation(labels, name, a, b, scales.get(name, 1.0))
    for name, was, became in _both(old.content, new.content):
        size = scales.get(content_scale_name(name), 1.0) * abs(_log_odds(became) - _log_odds(was))
        yield from _number("node", labels, content_scale_name(name), was, became, size)
    for number in range(max(len(old.count_costs), len(new.count_costs))):
        # The last cost of a node also applies to more zones.
        cost, other = (costs[min(number, len(costs) - 1)] for costs in (old.count_costs, new.count_costs))
        size = scales.get(COUNT, 1.0) * abs(other - cost)
        yield from _number("node", labels, f"{COUNT}:{number}", cost, other, size)


def _changes_of_expectation(
    labels: tuple[str | None, ...],
    name: str,
    old: NumericExpectation | None,
    new: NumericExpectation | None,
    scale: float,
) -> Iterator[SizedChange]:
    """Changes of the value and the variance of a numeric attribute. An added or removed one has size 1 deviation."""
    value_size, variance_size = scale, 0.0
    if old is not None and new is not None:
        value_size = scale * abs(new.value - old.value) / math.sqrt(min(old.variance, new.variance))
        variance_size = scale * 0.5 * abs(math.log(new.variance / old.variance))
    was, became = ((None, None) if each is None else (each.value, each.variance) for each in (old, new))
    yield from _number("node", labels, f"{name}:value", was[0], became[0], value_size)
    yield from _number("node", labels, f"{name}:variance", was[1], became[1], variance_size)


def _edge_changes(old: LayoutModel, new: LayoutModel) -> Iterator[SizedChange]:
    kept = set(old.labels) & set(new.labels)
    for (upper, lower), was, became in _both(_edges(old), _edges(new)):
        if was == became or not {upper, lower} <= kept:  # added and removed nodes are listed already
            continue
        for relation, a, b in _both(was or {}, became or {}):
            names = _DESCRIPTORS.get(relation, ())
            for index in range(max(len(a or ()), len(b or ()))):
                # A missing edge has no cost.
                cost, other = (each[index] if each and index < len(each) else 0.0 for each in (a, b))
                name = names[index] if index < len(names) else str(index)
                size = old.scales.get(relation, 1.0) * abs(other - cost)
                yield from _number("edge", (upper, lower), f"{relation}:{name}", cost, other, size)


def _edges(model: LayoutModel) -> dict[tuple[str | None, str | None], Mapping[str, tuple[float, ...]]]:
    def ends(edge: ModelEdge) -> tuple[str | None, str | None]:
        return edge.upper, edge.lower

    return {ends(edge): edge.costs for edge in model.edges}


def _number(
    part: Literal["node", "edge", "model"],
    labels: tuple[str | None, ...],
    attribute: str,
    old: float | None,
    new: float | None,
    size: float,
) -> Iterator[SizedChange]:
    """The change of one number; nothing if it is equal."""
    if old != new:
        change = Change(part=part, labels=list(labels), attribute=attribute, old=old, new=new)
        yield SizedChange(size, change)


def _both(old: Mapping[K, V], new: Mapping[K, V]) -> Iterator[tuple[K, V | None, V | None]]:
    """Every key with its values in `old` and `new`, None where it is missing; keys of `old` first."""
    for key in dict.fromkeys((*old, *new)):
        yield key, old.get(key), new.get(key)


def _distance(old: float | None, new: float | None) -> float:
    return abs((new or 0.0) - (old or 0.0))


def _log_odds(expectation: float | None) -> float:
    """Log odds of an expectation value, clipped to the bounds of its cost; 0 for a missing value."""
    sure = 0.5 if expectation is None else min(max(expectation, SUREST), 1 - SUREST)
    return math.log(sure / (1 - sure))
