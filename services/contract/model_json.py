"""A layout graph model as JSON: what server and workers exchange and the store keeps.

`services.layout.model.model_document` writes, reads and checks it; it has the bounds of every number.
"""

from collections.abc import Mapping, Sequence
from typing import NotRequired, TypedDict

Row = Sequence[float]


class NodeJson(TypedDict):
    """One label of the model; None: that of zones without a label."""

    label: str | None
    zones: float
    cost: float
    numeric: Mapping[str, Mapping[str, float]]
    content: Mapping[str, float]
    count_costs: Row
    content_weights: NotRequired[Mapping[str, float]]
    joining: NotRequired[float]
    pieces: NotRequired[Mapping[str, float | Row]]


class EdgeJson(TypedDict):
    """What is expected of two nodes, which are named by their places in the list."""

    upper: int
    lower: int
    costs: Mapping[str, Row]


class MemoryJson(TypedDict):
    """The sufficient statistics, which learning goes on from; rows of sums are in the order of the model's nodes."""

    pages: float
    descriptors: Sequence[str]
    nodes: list[Mapping[str, float | Row | Mapping[str, Row]]]
    edges: list[Mapping[str, float | Row]]
    certainty: Mapping[str, float]


class ModelJson(TypedDict):
    """A layout graph model."""

    format: str
    format_version: int
    name: str
    samples: int
    nodes: list[NodeJson]
    edges: list[EdgeJson]
    scales: Mapping[str, float]
    calibration: Mapping[str, float]
    memory: MemoryJson | None
    table: NotRequired[Mapping[str, object] | None]
