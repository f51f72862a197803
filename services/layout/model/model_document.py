"""Layout graph models as JSON documents with a format version; documents from outside are checked.

The sufficient statistics of a model are its key `memory`: stored documents and the HTTP contract have that name.
"""

from collections.abc import Mapping
from typing import Any

from services.contract.layout import LONGEST_LABEL
from services.layout.model.layout_model import (
    LARGEST,
    LARGEST_SUM,
    LEAST_VARIANCE,
    MODEL_FORMAT,
    MODEL_FORMAT_VERSION,
    MOST_BIAS,
    MOST_LABELS,
    MOST_WEIGHT,
    Calibration,
    EdgeStatistics,
    LayoutModel,
    ModelEdge,
    ModelNode,
    ModelStatistics,
    NodeStatistics,
    NumericExpectation,
)
from services.layout.page import InvalidLayout, is_finite_number

MOST_NAMES = 500
"""Of attributes, in one mapping."""
MOST_DESCRIPTORS = 100
LONGEST_NAME = 100


def model_to_document(model: LayoutModel) -> dict[str, Any]:
    """`model` as JSON can hold it; `model_from_document` reads it back."""
    index = {node.label: position for position, node in enumerate(model.nodes)}
    return {
        "format": MODEL_FORMAT,
        "format_version": MODEL_FORMAT_VERSION,
        "name": model.name,
        "samples": model.samples,
        "nodes": [_node_document(node) for node in model.nodes],
        "edges": [
            {
                "upper": index[edge.upper],
                "lower": index[edge.lower],
                "costs": {name: list(costs) for name, costs in edge.costs.items()},
            }
            for edge in model.edges
        ],
        "scales": dict(model.scales),
        "calibration": {
            "mean": model.calibration.mean,
            "deviation": model.calibration.deviation,
            "pages": model.calibration.pages,
            "bias": model.calibration.bias,
        },
        "memory": None if model.statistics is None else _statistics_document(model.statistics, index),
    }


def _node_document(node: ModelNode) -> dict[str, Any]:
    return {
        "label": node.label,
        "zones": node.zones,
        "cost": node.cost,
        "numeric": {
            name: {"value": expected.value, "variance": expected.variance, "weight": expected.weight}
            for name, expected in node.numeric.items()
        },
        "content": dict(node.content),
        "content_weights": dict(node.content_weights),
        "count_costs": list(node.count_costs),
    }


def _statistics_document(statistics: ModelStatistics, index: Mapping[str | None, int]) -> dict[str, Any]:
    return {
        "pages": statistics.pages,
        "descriptors": list(statistics.descriptors),
        "nodes": [
            {
                "zones": node.zones,
                "numeric": {name: list(sums) for name, sums in node.numeric.items()},
                "content": {name: list(sums) for name, sums in node.content.items()},
                "counts": list(node.counts),
            }
            for node in statistics.nodes
        ],
        "edges": [
            {
                "upper": index[edge.upper],
                "lower": index[edge.lower],
                "seen": list(edge.seen),
            }
            for edge in statistics.edges
        ],
        "certainty": dict(statistics.certainty),
    }


def model_from_document(document: Any) -> LayoutModel:
    """The model that a document describes.

    Raises
    ------
    InvalidLayout
        When it is not a layout graph model, one of a newer form, or damaged; the field is named.
    """
    entries = _object(document, "the model")
    if entries.get("format") != MODEL_FORMAT:
        raise InvalidLayout(
            f"format: this is not a {MODEL_FORMAT}. Send what GET /layout/models/{{name}} answers.", "format"
        )
    version = entries.get("format_version")
    if version != MODEL_FORMAT_VERSION or isinstance(version, bool):
        shown = f"{version:g}" if is_finite_number(version) else "this one"
        raise InvalidLayout(
            f"format_version: this service reads version {MODEL_FORMAT_VERSION}, not {shown}. "
            "Export the model from a service of the same release, or initialize it again from samples.",
            "format_version",
        )
    nodes = tuple(
        _read_node(each, f"nodes[{k}]")
        for k, each in enumerate(_list(entries.get("nodes"), "nodes", MOST_LABELS + 1))
    )
    labels = [node.label for node in nodes]
    if not labels or labels[0] is not None:
        raise InvalidLayout("nodes: the first node must be null, with label null.", "nodes")
    if len(set(labels)) != len(labels):
        raise InvalidLayout("nodes: every label may occur once.", "nodes")
    edges = tuple(
        _read_edge(each, labels, f"edges[{k}]")
        for k, each in enumerate(_list(entries.get("edges"), "edges", (MOST_LABELS + 1) ** 2))
    )
    if len({(edge.upper, edge.lower) for edge in edges}) != len(edges):
        raise InvalidLayout("edges: every pair of labels may occur once.", "edges")
    calibration = _object(entries.get("calibration"), "calibration")
    return LayoutModel(
        name=_name(entries.get("name"), "name"),
        samples=_whole(entries.get("samples"), "samples"),
        nodes=nodes,
        edges=edges,
        scales=_numbers(entries.get("scales"), "scales", 0.0, MOST_WEIGHT),
        calibration=Calibration(
            _number(calibration.get("mean"), "calibration.mean"),
            _number(calibration.get("deviation"), "calibration.deviation", 1e-6),
            _whole(calibration.get("pages"), "calibration.pages"),
            _number(calibration.get("bias", 0.0), "calibration.bias", -MOST_BIAS, MOST_BIAS),
        ),
        statistics=None if entries.get("memory") is None else _read_statistics(entries["memory"], labels),
    )


def _read_node(document: Any, where: str) -> ModelNode:
    entries = _object(document, where)
    label = entries.get("label")
    numeric = {}
    for name, each in _mapping(entries.get("numeric"), f"{where}.numeric").items():
        place = f"{where}.numeric.{name}"
        expected = _object(each, place)
        numeric[name] = NumericExpectation(
            _number(expected.get("value"), f"{place}.value"),
            _number(expected.get("variance"), f"{place}.variance", LEAST_VARIANCE),
            _number(expected.get("weight", 1.0), f"{place}.weight", 0.0, MOST_WEIGHT),
        )
    counts = _list(entries.get("count_costs"), f"{where}.count_costs", MOST_DESCRIPTORS)
    if len(counts) < 2:
        raise InvalidLayout(
            f"{where}.count_costs: the costs of none and of one are needed.", f"{where}.count_costs"
        )
    return ModelNode(
        label=None if label is None else _label(label, f"{where}.label"),
        zones=_number(entries.get("zones"), f"{where}.zones", 0.0),
        cost=_number(entries.get("cost"), f"{where}.cost"),
        numeric=numeric,
        content=_numbers(entries.get("content"), f"{where}.content", 0.0, 1.0),
        count_costs=tuple(_number(cost, f"{where}.count_costs") for cost in counts),
        content_weights=_numbers(
            entries.get("content_weights", {}), f"{where}.content_weights", 0.0, MOST_WEIGHT
        ),
    )


def _read_edge(document: Any, labels: list[str | None], where: str) -> ModelEdge:
    entries = _object(document, where)
    upper, lower = _read_ends(entries, labels, where)
    return ModelEdge(upper, lower, _rows(entries.get("costs"), f"{where}.costs", -LARGEST))


def _read_ends(
    entries: Mapping[str, Any], labels: list[str | None], where: str
) -> tuple[str | None, str | None]:
    ends = []
    for end in ("upper", "lower"):
        index = _whole(entries.get(end), f"{where}.{end}")
        if index >= len(labels):
            raise InvalidLayout(f"{where}.{end}: there is no node {index}.", f"{where}.{end}")
        ends.append(labels[index])
    return ends[0], ends[1]


def _read_statistics(document: Any, labels: list[str | None]) -> ModelStatistics:
    entries = _object(document, "memory")
    nodes = [
        _read_node_statistics(each, f"memory.nodes[{k}]")
        for k, each in enumerate(_list(entries.get("nodes"), "memory.nodes", len(labels)))
    ]
    if len(nodes) != len(labels):
        raise InvalidLayout("memory.nodes: one is needed for each of the model's nodes.", "memory.nodes")
    names = _list(entries.get("descriptors"), "memory.descriptors", MOST_NAMES)
    descriptors = tuple(_name(name, "memory.descriptors") for name in names)
    edges = []
    for k, each in enumerate(_list(entries.get("edges"), "memory.edges", len(labels) ** 2)):
        where = f"memory.edges[{k}]"
        edge = _object(each, where)
        upper, lower = _read_ends(edge, labels, where)
        seen = _row(edge.get("seen"), f"{where}.seen", 0.0, LARGEST_SUM, MOST_NAMES)
        if len(seen) != len(descriptors):
            raise InvalidLayout(f"{where}.seen: one number is needed for each descriptor.", f"{where}.seen")
        edges.append(EdgeStatistics(upper, lower, seen))
    return ModelStatistics(
        pages=_number(entries.get("pages"), "memory.pages", 0.0, LARGEST_SUM),
        descriptors=descriptors,
        nodes=tuple(nodes),
        edges=tuple(edges),
        certainty=_numbers(entries.get("certainty"), "memory.certainty", 0.0, LARGEST),
    )


def _read_node_statistics(document: Any, where: str) -> NodeStatistics:
    entries = _object(document, where)
    numeric, content = {}, {}
    for name, sums in _rows(entries.get("numeric"), f"{where}.numeric", -LARGEST_SUM, LARGEST_SUM).items():
        if len(sums) != 3 or sums[0] < 0 or sums[2] < 0:
            place = f"{where}.numeric.{name}"
            raise InvalidLayout(f"{place}: expected a count, a sum and a sum of squares.", place)
        numeric[name] = (sums[0], sums[1], sums[2])
    for name, sums in _rows(entries.get("content"), f"{where}.content", 0.0, LARGEST_SUM).items():
        if len(sums) != 2 or sums[1] > sums[0] * (1 + 1e-6):
            place = f"{where}.content.{name}"
            raise InvalidLayout(f"{place}: expected a count and a sum that is not larger.", place)
        content[name] = (sums[0], sums[1])
    counts = _list(entries.get("counts"), f"{where}.counts", MOST_DESCRIPTORS)
    return NodeStatistics(
        zones=_number(entries.get("zones"), f"{where}.zones", 0.0, LARGEST_SUM),
        numeric=numeric,
        content=content,
        counts=tuple(_number(pages, f"{where}.counts", 0.0, LARGEST_SUM) for pages in counts),
    )


def _rows(value: Any, where: str, least: float, largest: float = LARGEST) -> dict[str, tuple[float, ...]]:
    """Lists of numbers by name."""
    entries = _mapping(value, where)
    return {name: _row(each, f"{where}.{name}", least, largest) for name, each in entries.items()}


def _row(
    value: Any, where: str, least: float, largest: float = LARGEST, most: int = MOST_DESCRIPTORS
) -> tuple[float, ...]:
    return tuple([_number(number, where, least, largest) for number in _list(value, where, most)])


def _object(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InvalidLayout(f"{where}: expected an object.", where)
    return value


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    entries = _object(value, where)
    if len(entries) > MOST_NAMES:
        raise InvalidLayout(f"{where}: {len(entries)} names; at most {MOST_NAMES} are read.", where)
    for name in entries:
        _name(name, where)
    return entries


def _numbers(value: Any, where: str, least: float, largest: float) -> dict[str, float]:
    entries = _mapping(value, where)
    return {name: _number(number, f"{where}.{name}", least, largest) for name, number in entries.items()}


def _list(value: Any, where: str, most: int) -> list[Any]:
    if not isinstance(value, list):
        raise InvalidLayout(f"{where}: expected a list.", where)
    if len(value) > most:
        raise InvalidLayout(f"{where}: {len(value)} entries; at most {most} are read.", where)
    return value


def _name(value: Any, where: str) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= LONGEST_NAME or not value.isprintable():
        raise InvalidLayout(f"{where}: expected 1 to {LONGEST_NAME} printable characters.", where)
    return value


def _label(value: Any, where: str) -> str:
    """A label that zones of samples may have too, so that what is recognized can be sent as a sample."""
    label = _name(value, where)
    if len(label) > LONGEST_LABEL or label != label.strip():
        raise InvalidLayout(
            f"{where}: expected 1 to {LONGEST_LABEL} printable characters without blanks around them.", where
        )
    return label


def _number(value: Any, where: str, least: float = -LARGEST, largest: float = LARGEST) -> float:
    if type(value) is float and least <= value <= largest:  # as nearly all are; NaN is within no bounds
        return value
    if not is_finite_number(value) or not least <= value <= largest:
        raise InvalidLayout(f"{where}: expected a number from {least:g} to {largest:g}.", where)
    return float(value)


def _whole(value: Any, where: str) -> int:
    number = _number(value, where, 0.0)
    if number != int(number):
        raise InvalidLayout(f"{where}: expected a whole number.", where)
    return int(number)
