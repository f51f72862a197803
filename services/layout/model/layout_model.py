"""The layout graph model of a document class as plain values, ready for JSON; `CompiledModel` has its arrays.

It has a node for every label and one for null. A node has mean and variance of every numeric attribute (its weight is
the inverse variance), an expectation for every content feature, and the costs of 0, 1, 2, ... zones with its label; an
edge has a look-up table for every relation. `scales` has one factor for each attribute.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from services.layout.tables.table_model import TableModel

MODEL_FORMAT = "layout-graph-model"
MODEL_FORMAT_VERSION = 1
"""The number increases when earlier code cannot read a new model."""

MOST_LABELS = 60
"""Of one class; no class of the field's data sets has half as many, and tables of edges grow with the square."""

LARGEST = 1e9
"""Largest absolute value of any number of a model. Learning clips to it, so that the stored model can be read again."""

LARGEST_SUM = 1e15
"""Of its sufficient statistics: squares of places on 200 pages of 10 000 zones have 1e14 together."""

MOST_WEIGHT = 1e3
"""Of an attribute: its scale, and what learning has multiplied its weight with; they are some units."""

LEAST_VARIANCE = 1e-9
"""Of a numeric attribute."""

MOST_BIAS = 100.0
"""Of a calibration, and of log odds that a model learns; both are some units."""


_PRIOR_ZONES = 1.0
"""As if so many zones of a label had been seen that are whole."""


@dataclass(frozen=True, slots=True)
class NumericExpectation:
    """Typical value of a numeric attribute of a model node; its weight is the inverse of `variance` (5.6.1).

    `weight` is what adaptive learning has multiplied that with (5.5).
    """

    value: float
    variance: float
    weight: float = 1.0


@dataclass(frozen=True, slots=True)
class PieceStatistics:
    """What verified pages say of the pieces that segmentation makes of the zones of a label.

    `joining` are log odds, beyond the usual ones, that two neighbouring zones of segmentation with the label are pieces
    of one zone, and `certainty` how sure they are: the second derivative of the negative log likelihood. `whole`
    verified zones were found in one piece, `divided` ones in several. `widths` and `heights` are those of verified
    zones, as binary logarithms of shares of the page: their number, their sum and that of their squares. `merged`
    verified zones were found in one zone with one of another label, `apart` ones were not; `within` ones were parts of
    a larger zone.
    """

    joining: float = 0.0
    certainty: float = 0.0
    whole: float = 0.0
    divided: float = 0.0
    widths: tuple[float, float, float] = (0.0, 0.0, 0.0)
    heights: tuple[float, float, float] = (0.0, 0.0, 0.0)
    merged: float = 0.0
    apart: float = 0.0
    within: float = 0.0

    @property
    def share_within(self) -> float:
        """Share of the zones of the label that are parts of larger ones of segmentation, by what the class has seen."""
        return self.within / (self.whole + self.divided + self.within + _PRIOR_ZONES)


@dataclass(frozen=True, slots=True)
class NodeWords:
    """One aspect of what zones of a label say: how many zones had any token, and how many each of them."""

    zones: float
    tokens: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class ModelNode:
    """One logical component of a class; `label` None is null, what zones without a label look like.

    `zones` is how many zones of the samples had the label. `content` holds the expectation value, 0-1, of every
    content feature (Equation 5.3). `count_costs[n]` is the cost of n zones with the label on a page, the last
    one also of more; `count_costs[0]` is thus the cost of the component's absence. `pieces` is what is known of the
    pieces of its zones, `words` what they and their neighbours say, by aspect (`graph.zone_words`). `content_weights`
    are those of features and aspects that learning has changed.
    """

    label: str | None
    zones: float
    cost: float
    numeric: Mapping[str, NumericExpectation]
    content: Mapping[str, float]
    count_costs: tuple[float, ...]
    content_weights: Mapping[str, float] = field(default_factory=dict)
    pieces: PieceStatistics = PieceStatistics()
    words: Mapping[str, NodeWords] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ModelEdge:
    """Relative position of zones of two components; `upper` is the component of the zone that starts higher.

    `costs[relation][d]` is the cost of descriptor d of a qualitative relation: a look-up table that is least for
    the dominant descriptor (5.6.1), the one that these two components have most often compared with any others.
    """

    upper: str | None
    lower: str | None
    costs: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True, slots=True)
class Calibration:
    """Cost a zone that pages of the class have when they are matched: its mean and standard deviation.

    `pages` says from how many pages, each view of a sample being one, that had no part in the model it was measured;
    0: both are assumed. `bias` is added to the cost of every page: what wrong decisions on classes have taught.

    `evidence_slope` and `evidence_intercept` make the evidence of a label log odds of being right by this model; they
    were measured on `evidence_zones` zones of such pages (`recognition.label_calibration`).
    """

    mean: float
    deviation: float
    pages: int
    bias: float = 0.0
    evidence_slope: float = 1.0
    evidence_intercept: float = 0.0
    evidence_zones: int = 0


@dataclass(frozen=True, slots=True)
class NodeStatistics:
    """Sufficient statistics of a model node; a page that was seen in two views counts half in each.

    `numeric` holds for each attribute how many zones had a known value, the sum of the values and that of their
    squares; `content` for each feature how many zones were read and the sum of its confidences; `counts[n]` how many
    pages had n zones with the label.
    """

    zones: float
    numeric: Mapping[str, tuple[float, float, float]]
    content: Mapping[str, tuple[float, float]]
    counts: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class EdgeStatistics:
    """How many pairs of zones of two components had each descriptor of each relation, as `descriptors` orders them."""

    upper: str | None
    lower: str | None
    seen: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ModelStatistics:
    """Sufficient statistics of a model, with which it learns from one page more without the pages before (5.5).

    `descriptors` names the columns of its edges, "relation:descriptor". `nodes` have the order of the model's nodes;
    edges without counts are left out. `certainty` has the certainty of each of the model's `scales`: the second
    derivative of the pages' negative log likelihood.
    """

    pages: float
    descriptors: tuple[str, ...]
    nodes: tuple[NodeStatistics, ...]
    edges: tuple[EdgeStatistics, ...]
    certainty: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class LayoutModel:
    """Layout graph model of a document class (5.3): nodes, edges between all of them, and weights.

    Models are compared by identity, so that a model can be a key of a cache.

    The first node is null. `scales` weigh every attribute by name; together with the variance of its node it
    makes the attribute's weight. An edge that is not listed has no cost. A model without `statistics` can
    learn too: they are then presumed from its values. `table` is that of the items, which are no nodes.
    """

    name: str
    samples: int
    nodes: tuple[ModelNode, ...]
    edges: tuple[ModelEdge, ...]
    scales: Mapping[str, float]
    calibration: Calibration
    statistics: ModelStatistics | None = None
    table: TableModel | None = None

    @property
    def labels(self) -> tuple[str | None, ...]:
        """Label of every node, None for null."""
        return tuple(node.label for node in self.nodes)
