"""Learning from a verified page: the models of the right and of the wrong class adapt (5.2, 5.5)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from services.contract.answers.learning import CostChange
from services.contract.layout_learning import DEFAULT_LEARNER, Learner, VerifiedPage
from services.layout.content.content_features import ContentFeatures
from services.layout.graph.layout_graph import LayoutGraph, build_graph
from services.layout.learning.class_decisions import accept_page, count_cost, prefer_class, refuse_page
from services.layout.learning.label_transfer import come_apart, transfer_labels
from services.layout.learning.learned_pieces import learn_pieces
from services.layout.learning.learners import learn_page
from services.layout.matching import NO_PROOF, MatchingParameters, match_directly
from services.layout.model.compiled_model import CompiledModel, compile_model
from services.layout.model.cost import build_cost_tables, labelling_cost
from services.layout.model.layout_model import Calibration, LayoutModel
from services.layout.model.learning_model import LearningModel, begin_learning, end_learning, with_labels
from services.layout.model.statistics import LabelledGraph, label_indices
from services.layout.page import Page
from services.layout.recognition.page_recognition import comparable_cost

Labels = tuple[str | None, ...]

_FORBIDDEN = 1e6
"""Cost of a label that a person has excluded: more than all other costs of a page."""


class LabelsMissing(ValueError):
    """A zone has no given label, and no model can find it."""

    def __init__(self, zone: str) -> None:
        super().__init__(zone)
        self.zone = zone


@dataclass(frozen=True, slots=True)
class LearnedModel:
    """A model after learning from a page, and the costs of the found and the verified labelling."""

    model: LayoutModel
    found: CostChange
    verified: CostChange


def adapt_models(
    verified: VerifiedPage[Page],
    models: Mapping[str, LayoutModel],
    learners: Mapping[str, Learner],
    content_names: tuple[str, ...],
    features: ContentFeatures | None = None,
) -> tuple[Labels, dict[str, LearnedModel]]:
    """The right labels of all zones, and the models that have learned from the page, by name.

    The model of the verified class learns from the page. If recognition chose the wrong class, the calibrations of both
    classes learn from the decision (`class_decisions`). A page without zones changes nothing, as in initialization.

    Parameters
    ----------
    verified
        The page, whose zones carry their content features, and the feedback on it.
    models
        The newest versions of the found and the verified class, by name. Classes without a version are left out.
    learners
        The learner of each model, by name; `DEFAULT_LEARNER` if it is missing.
    content_names
        Names of the content features.
    features
        They measure what is left of zones that hold a part with a label (`come_apart`); None: it has none.

    Raises
    ------
    LabelsMissing
        When zones have no given label and no model can find it.
    """
    if not verified.page.zones:
        return (), {}
    graph = build_graph(verified.page, content_names, printed=verified.found_page)
    found = tuple(verified.found_labels.get(zone.id) for zone in verified.page.zones)
    right_class = models.get(verified.verified_class or "")
    is_right = verified.found_class == verified.verified_class
    wrong_class = None if is_right else models.get(verified.found_class or "")
    learning = None if right_class is None else begin_learning(right_class, graph.content_names)
    labels = _all_labels(verified, found, graph, learning)
    right = None if learning is None else _CalibratedModel(learning.model, learning.calibration)
    wrong = None
    if wrong_class is not None:
        compiled = compile_model(wrong_class, graph.content_names)
        wrong = _CalibratedModel(compiled, wrong_class.calibration)
    accepting, refusing = _decide(graph, right, wrong, verified.found_class)
    learned: dict[str, LearnedModel] = {}
    if learning is not None and right is not None and accepting is not None:
        learner = learners.get(learning.name, DEFAULT_LEARNER)
        page = _labelled(verified.page, labels)
        found_view = None
        if verified.found_page is not None:
            found_page = transfer_labels(page, verified.found_page)
            learning = replace(learning, pieces=learn_pieces([(page, found_page)], learning.pieces))
            found_page = come_apart(page, found_page)
            found_page = found_page if features is None else features.measure_page(found_page)
            found_view = LabelledGraph(build_graph(found_page, content_names), _labels_of(found_page))
        after = learn_page(
            replace(learning, calibration=accepting), LabelledGraph(graph, labels), learner, found_view
        )
        learned[learning.name] = LearnedModel(
            end_learning(after),
            *_changes(graph, right, _CalibratedModel(after.model, accepting), found, labels),
        )
    if wrong_class is not None and wrong is not None and refusing is not None:
        learned[wrong_class.name] = LearnedModel(
            replace(wrong_class, calibration=refusing),
            *_changes(graph, wrong, replace(wrong, calibration=refusing), found, labels),
        )
    return labels, learned


def _labelled(page: Page, labels: Labels) -> Page:
    zones = (replace(zone, label=label) for zone, label in zip(page.zones, labels, strict=True))
    return replace(page, zones=tuple(zones))


def _labels_of(page: Page) -> Labels:
    return tuple(zone.label for zone in page.zones)


def _all_labels(
    verified: VerifiedPage[Page], found: Labels, graph: LayoutGraph, right: LearningModel | None
) -> Labels:
    """The given labels; other zones have the found label if the class was right, else the label of a new matching."""
    ids = [zone.id for zone in verified.page.zones]
    given = verified.labels
    if verified.verified_class is None:
        return tuple(given.get(zone) for zone in ids)
    if verified.found_class == verified.verified_class:
        return tuple(given.get(zone, label) for zone, label in zip(ids, found, strict=True))
    if right is None:
        missing = [zone for zone in ids if zone not in given]
        if missing:
            raise LabelsMissing(missing[0])
        return tuple(given[zone] for zone in ids)
    state = with_labels(right, tuple(given.values()))
    tables = build_cost_tables(graph, state.model)
    node = tables.node.copy()
    for row, zone in enumerate(ids):
        if zone in given:
            allowed = state.labels.index(given[zone])
            node[row] += _FORBIDDEN
            node[row, allowed] -= _FORBIDDEN
    matching = match_directly(replace(tables, node=node), MatchingParameters())
    return tuple(state.labels[index] for index in matching.labels)


@dataclass(frozen=True, slots=True, eq=False)
class _CalibratedModel:
    """A compiled model and its calibration. Both are needed for the cost of a page."""

    model: CompiledModel
    calibration: Calibration


def _decide(
    graph: LayoutGraph,
    right: _CalibratedModel | None,
    wrong: _CalibratedModel | None,
    found_class: str | None,
) -> tuple[Calibration | None, Calibration | None]:
    """Calibrations of the right and of the wrong model after the decision on the class; None where there is no model.

    The page's cost under the right model is counted as that of a page which it has not seen.
    """
    taught_right, taught_wrong = (None if model is None else model.calibration for model in (right, wrong))
    cost = 0.0 if right is None else _least_cost(graph, right.model)
    other = 0.0 if wrong is None else _least_cost(graph, wrong.model)
    if taught_right is not None and taught_wrong is not None:
        taught_right, taught_wrong = prefer_class((cost, taught_right), (other, taught_wrong))
    elif taught_right is not None and found_class is None:
        taught_right = accept_page(cost, taught_right, graph.zones)
    elif taught_wrong is not None:
        taught_wrong = refuse_page(other, taught_wrong, graph.zones)
    return None if taught_right is None else count_cost(taught_right, cost), taught_wrong


def _changes(
    graph: LayoutGraph, before: _CalibratedModel, after: _CalibratedModel, found: Labels, verified: Labels
) -> tuple[CostChange, CostChange]:
    """Cost changes of the found and of the verified labelling."""
    of_found, of_verified = (
        CostChange(before=_cost(graph, before, labels), after=_cost(graph, after, labels))
        for labels in (found, verified)
    )
    return of_found, of_verified


def _cost(graph: LayoutGraph, model: _CalibratedModel, labels: Labels) -> float | None:
    """None where the model lacks a label, or for no finite cost."""
    compiled = model.model
    if not set(labels) <= set(compiled.labels):
        return None
    cost = sum(labelling_cost(graph, compiled, label_indices(labels, compiled.labels), compiled.scales))
    cost += model.calibration.bias * graph.zones
    return round(cost, 4) if math.isfinite(cost) else None


def _least_cost(graph: LayoutGraph, model: CompiledModel) -> float:
    """Least cost a zone of the page, by which classes are compared."""
    matching = match_directly(build_cost_tables(graph, model), NO_PROOF)
    return comparable_cost(graph, model, matching.labels) / max(1, graph.zones)
