"""Results of the recognition of a page."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from services.layout.model.cost import AttributeCost
from services.layout.page import Page, Zone
from services.layout.tables.item_table import ItemTable


@dataclass(frozen=True, slots=True)
class RecognizedZone:
    """A zone with the label that matching gave it, None for none of the model's.

    `confidence` is the probability, 0-1, that the label is right, given the class; `group` names the model
    node whose zones it is grouped with (5.3); `order` is its place in reading order, from 0. `evidence` are log odds
    that the label is right, from which its confidence is calibrated (`label_evidence`); None where nothing was matched.
    `others` are the labels that are nearly as probable, each with its probability, 0-1, if `label` is wrong. `several`
    is the probability, 0-1, that the zone is several, which samples of the class label apart; None: not judged.
    `shares` are, for labels of which the samples have one zone a page, the probabilities, 0-1, that this zone is it.
    """

    zone: Zone
    label: str | None
    confidence: float
    group: str | None
    order: int
    evidence: float | None = None
    others: Mapping[str, float] = field(default_factory=dict)
    several: float | None = None
    shares: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ClassMatch:
    """The match of a page and one model: its least `cost`, and the `probability`, 0-1, of the class.

    Among many models the cost of a class that was not matched is its unary score, or that of its genre
    (`services.layout.recognition.hierarchy`).
    `comparable_cost` is the cost a zone by which classes are compared (`classification.class_evidence`).
    """

    name: str
    model_version: int
    cost: float
    probability: float
    comparable_cost: float = 0.0


@dataclass(frozen=True, slots=True)
class ModelMatch:
    """The match behind the labels; `gap` is how far its cost may lie above the least one, 0 when optimal.

    `backbone` names for each model node the zone that matches it best (the one-to-one match of 5.4);
    `explanation` has the terms of the cost, largest first, if they were requested.
    """

    cost: float
    node_cost: float
    edge_cost: float
    count_cost: float
    optimal: bool
    gap: float
    backbone: Mapping[str, str]
    explanation: tuple[AttributeCost, ...] = ()


@dataclass(frozen=True, slots=True)
class Recognition:
    """The class of a page and the labels of its zones.

    `chosen` is None when there is no model, or when none fits (`unknown`): the zones are then labelled by the
    nearest model if there is one, else not at all. `classes` are all that competed, most probable first. `tables` are
    read after all else (`tables.reading`).
    """

    page: Page
    zones: tuple[RecognizedZone, ...]
    chosen: ClassMatch | None
    classes: tuple[ClassMatch, ...] = ()
    unknown_probability: float = 0.0
    match: ModelMatch | None = None
    tables: tuple[ItemTable, ...] = ()
    timings_ms: Mapping[str, float] = field(default_factory=dict)
