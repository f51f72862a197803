"""Layout structure recognition: class and labels of a page at once, from the models' least costs (5.2)."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.layout_graph import MOST_NEIGHBOURS, LayoutGraph, build_graph
from services.layout.graph.zone_words import key_zones
from services.layout.matching import (
    MatchingParameters,
    backbone_of,
    conditional_costs,
    match_directly,
    match_in_two_steps,
)
from services.layout.matching.cost_tables import CostTables, Matching
from services.layout.model.compiled_model import CompiledModel, comparable_scales, compile_model
from services.layout.model.cost import AttributeCost, build_cost_tables, explain_cost, labelling_cost
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.recognition.classification import classify
from services.layout.recognition.hierarchy import MOST_CANDIDATES, Competitor, rank_models
from services.layout.recognition.label_evidence import (
    are_single,
    label_confidences,
    label_evidence,
    other_labels,
    zone_shares,
)
from services.layout.recognition.results import ClassMatch, ModelMatch, Recognition, RecognizedZone

CONTENDER = 0.02
"""A class this probable, next to the most probable one, may still win when its match is searched for thoroughly:
on simulated pages that lowered the cost a zone by 0.17 at most, and its odds rise by no more than e^0.5."""


MOST_CONTENDERS = 12
"""Models that are matched thoroughly, the most probable first; more are too similar to be separated by proofs."""

MOST_ENTRIES, MOST_ENTRIES_TOGETHER = 6e7, 6e8
"""Of the tables of pairs of one model (8 bytes each), and of all models together (10 ns each). Beyond it zones are
joined to fewer neighbours: 500 zones keep all for a model of 60 labels, and for 200 models of 15."""


@dataclass(frozen=True, slots=True)
class VersionedModel:
    """A model that competes, its version in the store, and the genre that its class was given, if it was.

    One that `continues` a class describes the later pages of its documents.
    """

    model: LayoutModel
    version: int
    genre: str | None = None
    continues: str | None = None


@dataclass(frozen=True, slots=True)
class RecognitionParameters:
    """`method` chooses between the two ways of 5.4; `explain` adds the terms of the cost to the match.

    Of more than `most_candidates` models the hierarchy chooses that number of models for the search.
    """

    method: Literal["direct", "two-steps"] = "direct"
    explain: bool = False
    most_candidates: int = MOST_CANDIDATES
    matching: MatchingParameters = field(default_factory=MatchingParameters)


USUAL = RecognitionParameters()


@dataclass(frozen=True, slots=True, eq=False)
class _Match:
    model: VersionedModel
    compiled: CompiledModel
    matching: Matching
    backbone: dict[int, int]
    comparable_cost: float
    confidences: NDArray[np.float64] | None = None
    evidence: NDArray[np.float64] | None = None
    """Of labels (N,), of thorough matches (`label_evidence`). Not the tables themselves: those of a page of 500 zones
    and a model of 60 labels have 300 MB, and many models may compete."""
    others: NDArray[np.float64] | None = None
    """(N, L) `other_labels`, of thorough matches."""
    shares: NDArray[np.float64] | None = None
    """(N, L) `zone_shares` of labels that pages have once, of thorough matches."""

    @property
    def cost(self) -> float:
        return self.matching.cost

    @property
    def thorough(self) -> bool:
        return self.evidence is not None


@dataclass(frozen=True, slots=True, eq=False)
class _RankedOut:
    """A model that was not matched; its costs are those of the ranking, upper bounds of the least ones."""

    model: VersionedModel
    cost: float
    comparable_cost: float
    thorough: Literal[False] = False


def recognize_page(
    page: Page,
    models: Sequence[VersionedModel],
    content_names: tuple[str, ...],
    parameters: RecognitionParameters = RecognitionParameters(),
) -> Recognition:
    """Class and labels of a page whose zones carry their content features.

    The hierarchy chooses `most_candidates` candidates, which are first matched by local search only. The other models
    keep the cost of their ranking. Proofs of the least cost take most of the time, most of all for models that do not
    fit, so only the contenders for the class are matched with the full budget.

    Without models, or without zones, nothing is labelled and no class is chosen.
    """
    if not models or not page.zones:
        zones = tuple(RecognizedZone(zone, None, 0.0, None, order) for order, zone in enumerate(page.zones))
        return Recognition(page, zones, None)
    started = time.perf_counter()
    graph = _graph_for(page, models, content_names)
    matches = _match_all(graph, page, models, parameters)
    matched = time.perf_counter()
    probabilities, unknown = _classify(graph, matches)
    order = np.argsort(-probabilities, kind="stable")
    classes = tuple(
        ClassMatch(
            matches[index].model.model.name,
            matches[index].model.version,
            matches[index].cost,
            float(probabilities[index]),
            matches[index].comparable_cost / graph.zones,
        )
        for index in order
    )
    best = matches[order[0]]
    assert isinstance(best, _Match), "the most probable class was matched thoroughly"
    return Recognition(
        page=page,
        zones=_label_zones(page, best),
        chosen=None if unknown > probabilities[order[0]] else classes[0],
        classes=classes,
        unknown_probability=unknown,
        match=_report(page, graph, best, parameters.explain),
        timings_ms={
            "matching": (matched - started) * 1000,
            "classification": (time.perf_counter() - matched) * 1000,
        },
    )


def relabelled(
    seen: Recognition,
    page: Page,
    model: VersionedModel,
    content_names: tuple[str, ...],
    parameters: RecognitionParameters,
) -> Recognition:
    """The recognition with the zones of `page`, another grouping, labelled by the model of its chosen class.

    The classes keep their probabilities; the chosen one has the cost of the new match.
    """
    alone = recognize_page(page, [model], content_names, parameters)
    assert seen.chosen is not None, "a page of no class keeps its grouping"
    assert alone.match is not None, "a page that was matched has zones"
    chosen = replace(seen.chosen, cost=alone.match.cost)
    classes = tuple(chosen if each.name == chosen.name else each for each in seen.classes)
    return replace(seen, page=page, zones=alone.zones, chosen=chosen, classes=classes, match=alone.match)


def match_graph(
    graph: LayoutGraph, page: Page, model: CompiledModel, parameters: RecognitionParameters
) -> tuple[CostTables, Matching, dict[int, int]]:
    """Tables, best labelling and backbone (label -> zone, null left out) of one model."""
    tables = build_cost_tables(graph, model)
    if parameters.method == "two-steps":
        boxes = np.array([zone.box for zone in page.zones])
        two_steps = match_in_two_steps(tables, boxes, parameters.matching)
        return tables, two_steps.matching, dict(two_steps.backbone)
    matching = match_directly(tables, parameters.matching)
    backbone = backbone_of(tables, matching.labels)
    return tables, matching, {label: zone for label, zone in backbone.items() if label}


def comparable_cost(graph: LayoutGraph, model: CompiledModel, labels: NDArray[np.intp]) -> float:
    """Cost of a labelling by the usual weights, which are the same for all models."""
    return sum(labelling_cost(graph, model, labels, comparable_scales(graph.content_names)))


def _graph_for(page: Page, models: Sequence[VersionedModel], content_names: tuple[str, ...]) -> LayoutGraph:
    """The page's graph, with as many pairs as tables for these models may have."""
    labels = [len(model.model.nodes) ** 2 for model in models]
    most_pairs = min(MOST_ENTRIES / max(labels), MOST_ENTRIES_TOGETHER / sum(labels))
    # Zones that are each other's neighbours share a pair: 500 have 23 pairs each, not 40.
    neighbours = max(1, min(MOST_NEIGHBOURS, int(1.5 * most_pairs / len(page.zones))))
    return build_graph(page, content_names, neighbours)


def _match_all(
    graph: LayoutGraph, page: Page, models: Sequence[VersionedModel], parameters: RecognitionParameters
) -> list[_Match | _RankedOut]:
    """Matches of all models, those of the contenders thorough; the most probable class is among them."""
    quick = replace(parameters, matching=replace(parameters.matching, max_nodes=0, max_sweeps=0))
    if len(models) == 1:
        return [_match(graph, page, models[0], parameters, thorough=True)]
    matches: list[_Match | _RankedOut]
    if len(models) > parameters.most_candidates:
        matches = _match_candidates(graph, page, models, quick)
    else:
        matches = [_match(graph, page, model, quick, thorough=False) for model in models]
    while True:
        probabilities, _ = _classify(graph, matches)
        contenders = probabilities >= CONTENDER * probabilities.max()
        ranked = [int(index) for index in np.argsort(-probabilities, kind="stable") if contenders[index]]
        room = MOST_CONTENDERS - sum(match.thorough for match in matches)
        # The first one is matched even where there is no room left: its labels are the answer.
        left = [index for index in ranked[: max(1, room)] if not matches[index].thorough]
        if not left:
            return matches
        for index in left:
            matches[index] = _match(graph, page, models[index], parameters, thorough=True)


def _match_candidates(
    graph: LayoutGraph, page: Page, models: Sequence[VersionedModel], parameters: RecognitionParameters
) -> list[_Match | _RankedOut]:
    """Matches of the candidates of the hierarchy; ranked costs of all others."""
    competitors = [
        Competitor(each.model, compile_model(each.model, graph.content_names), each.genre) for each in models
    ]
    ranking = rank_models(graph, competitors, parameters.most_candidates)
    candidates = set(ranking.candidates)
    return [
        _match(graph, page, model, parameters, thorough=False)
        if index in candidates
        else _RankedOut(model, cost, comparable)
        for index, (model, cost, comparable) in enumerate(
            zip(models, ranking.costs.tolist(), ranking.comparable.tolist(), strict=True)
        )
    ]


def _classify(
    graph: LayoutGraph, matches: Sequence[_Match | _RankedOut]
) -> tuple[NDArray[np.float64], float]:
    return classify(
        np.array([match.comparable_cost for match in matches]) / graph.zones,
        [match.model.model.calibration for match in matches],
        graph.zones,
    )


def _match(
    graph: LayoutGraph,
    page: Page,
    model: VersionedModel,
    parameters: RecognitionParameters,
    *,
    thorough: bool,
) -> _Match:
    compiled = compile_model(model.model, graph.content_names)
    tables, matching, backbone = match_graph(graph, page, compiled, parameters)
    cost = comparable_cost(graph, compiled, matching.labels)
    match = _Match(model, compiled, matching, backbone, cost)
    if not thorough:
        return match
    conditional = conditional_costs(tables, matching.labels)
    confidences = label_confidences(conditional, matching.labels)
    evidence = label_evidence(
        tables, matching.labels, conditional, model.model.samples, is_read=graph.is_read
    )
    others = other_labels(conditional, matching.labels, compiled.counts)
    shares = np.where(are_single(compiled.counts), zone_shares(tables, matching.labels), 0.0)
    return replace(match, confidences=confidences, evidence=evidence, others=others, shares=shares)


def _label_zones(page: Page, match: _Match) -> tuple[RecognizedZone, ...]:
    """Zones with labels and confidences, which follow from the costs of the other labels.

    The weights of the costs are those under which true labels are most probable given the others, so that their
    exponentials are probabilities (`scale_fitting`).
    """
    assert match.confidences is not None, "the most probable class was matched thoroughly"
    assert match.evidence is not None, "evidence comes with confidences"
    assert match.others is not None, "other labels come with confidences"
    assert match.shares is not None, "shares come with confidences"
    chosen = match.matching.labels
    labels = match.compiled.labels
    return tuple(
        RecognizedZone(
            zone=zone,
            label=labels[chosen[index]],
            confidence=float(match.confidences[index]),
            group=labels[chosen[index]],
            order=index,
            evidence=float(match.evidence[index]),
            others={
                name: float(share)
                for name, share in zip(labels, match.others[index], strict=True)
                if name is not None and share > 0
            },
            shares={
                name: float(share)
                for name, share in zip(labels, match.shares[index], strict=True)
                if name is not None and share > 0
            },
        )
        for index, zone in enumerate(page.zones)
    )


def _report(page: Page, graph: LayoutGraph, match: _Match, explain: bool) -> ModelMatch:
    matching, labels = match.matching, match.compiled.labels
    node, edge, count = labelling_cost(graph, match.compiled, matching.labels, match.compiled.scales)
    names = [zone.id for zone in page.zones]
    return ModelMatch(
        cost=matching.cost,
        node_cost=node,
        edge_cost=edge,
        count_cost=count,
        optimal=matching.optimal,
        gap=matching.gap,
        backbone={str(labels[label]): names[zone] for label, zone in sorted(match.backbone.items())},
        explanation=_with_keys(explain_cost(graph, match.compiled, matching.labels, names), page)
        if explain
        else (),
    )


def _with_keys(terms: tuple[AttributeCost, ...], page: Page) -> tuple[AttributeCost, ...]:
    """The terms; those of a value's key tell the zone that is the key of the value."""
    place = {zone.id: index for index, zone in enumerate(page.zones)}
    keys = key_zones(page)

    def with_key(term: AttributeCost) -> AttributeCost:
        key = keys[place[term.zone]].get(term.attribute)
        return term if key is None else replace(term, other=page.zones[key].id)

    return tuple(map(with_key, terms))
