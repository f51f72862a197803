"""What a person's correction of one page makes of the models that it concerns (5.2, 5.5)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from services.contract.layout_learning import DEFAULT_LEARNER, Learner
from services.layout.graph.layout_graph import LayoutGraph, build_graph
from services.layout.learning.class_decisions import accept_page, count_cost, prefer_class, refuse_page
from services.layout.learning.learners import learn_page
from services.layout.matching import MatchingParameters, match_directly
from services.layout.model.compiled_model import CompiledModel, compile_model
from services.layout.model.cost import build_cost_tables, labelling_cost
from services.layout.model.layout_model import Calibration, LayoutModel
from services.layout.model.learning_model import LearningModel, begin_learning, end_learning, with_labels
from services.layout.model.statistics import LabelledGraph, label_indices
from services.layout.page import Page
from services.layout.recognition.page_recognition import comparable_cost

Labels = tuple[str | None, ...]

_QUICK = MatchingParameters(max_nodes=0, max_sweeps=0)
"""For models that a page is not of: proofs take longest there, and move the least cost little."""
_FORBIDDEN = 1e6
"""Cost of a label that a person has ruled out: more than all else of a page together."""


class LabelsMissing(ValueError):
    """A zone of which nobody can tell the label."""

    def __init__(self, zone: str) -> None:
        super().__init__(zone)
        self.zone = zone


@dataclass(frozen=True, slots=True)
class VerifiedPage:
    """A recognized page and what a person said of it.

    `found` are the labels of its zones by the class `found_class` (None: by the nearest one, the page being of none).
    `verified_class` None says that it is of no class. `verified` holds the labels that the person gave, by zone's id.
    """

    page: Page
    found_class: str | None
    found: Labels
    verified_class: str | None
    verified: Mapping[str, str | None]


@dataclass(frozen=True, slots=True)
class CostChange:
    """Cost of one labelling under a model before and after it has learned, its class's bias for all zones added.

    None where the model has not all of its labels.
    """

    before: float | None
    after: float | None


@dataclass(frozen=True, slots=True)
class LearnedModel:
    """A model that has learned from a page, and what the found and the verified labelling cost under it."""

    model: LayoutModel
    found: CostChange
    verified: CostChange


def learn_from_feedback(
    said: VerifiedPage,
    models: Mapping[str, LayoutModel],
    learners: Mapping[str, Learner],
    content_names: tuple[str, ...],
) -> tuple[Labels, dict[str, LearnedModel]]:
    """Labels of all zones as they are taken to be right, and the models that have learned, by name.

    The verified class's model learns the page. Where another class was chosen, or none, or one for a page of none,
    the calibrations of the models concerned learn the decision. `models` has them in their newest versions; a class
    that has no version yet is left out. The zones carry their content features. A page without zones teaches nothing,
    as in initialization.

    Raises
    ------
    LabelsMissing
        When zones are not named and there is no model that could tell their labels.
    """
    if not said.page.zones:
        return (), {}
    graph = build_graph(said.page, content_names)
    wrong_class = None if said.found_class == said.verified_class else said.found_class
    chosen = models.get(wrong_class) if wrong_class is not None else None
    taught = models.get(said.verified_class) if said.verified_class is not None else None
    pupil = None if taught is None else begin_learning(taught, graph.content_names)
    labels = _all_labels(said, graph, pupil)
    right = None if pupil is None else _Judge(pupil.model, pupil.calibration)
    wrong = None if chosen is None else _Judge(compile_model(chosen, graph.content_names), chosen.calibration)
    accepting, refusing = _decide(graph, right, wrong, said.found_class)
    learned: dict[str, LearnedModel] = {}
    if pupil is not None and right is not None and accepting is not None:
        learner = learners.get(pupil.name, DEFAULT_LEARNER)
        after = learn_page(replace(pupil, calibration=accepting), LabelledGraph(graph, labels), learner)
        learned[pupil.name] = LearnedModel(
            end_learning(after),
            *_changes(graph, right, _Judge(after.model, accepting), said.found, labels),
        )
    if chosen is not None and wrong is not None and refusing is not None:
        learned[chosen.name] = LearnedModel(
            replace(chosen, calibration=refusing),
            *_changes(graph, wrong, replace(wrong, calibration=refusing), said.found, labels),
        )
    return labels, learned


def _all_labels(said: VerifiedPage, graph: LayoutGraph, right: LearningModel | None) -> Labels:
    """Labels that were given, and those of the other zones: as found where the class was right, else as matched."""
    ids = [zone.id for zone in said.page.zones]
    if said.verified_class is None:
        return tuple(said.verified.get(zone) for zone in ids)
    if said.found_class == said.verified_class:
        return tuple(said.verified.get(zone, label) for zone, label in zip(ids, said.found, strict=True))
    if right is None:
        missing = [zone for zone in ids if zone not in said.verified]
        if missing:
            raise LabelsMissing(missing[0])
        return tuple(said.verified[zone] for zone in ids)
    state = with_labels(right, tuple(said.verified.values()))
    tables = build_cost_tables(graph, state.model)
    node = tables.node.copy()
    for row, zone in enumerate(ids):
        if zone in said.verified:
            allowed = state.labels.index(said.verified[zone])
            node[row] += _FORBIDDEN
            node[row, allowed] -= _FORBIDDEN
    matching = match_directly(replace(tables, node=node), MatchingParameters())
    return tuple(state.labels[index] for index in matching.labels)


@dataclass(frozen=True, slots=True, eq=False)
class _Judge:
    """What tells the cost of a page of a class."""

    model: CompiledModel
    calibration: Calibration


def _decide(
    graph: LayoutGraph, right: _Judge | None, wrong: _Judge | None, found_class: str | None
) -> tuple[Calibration | None, Calibration | None]:
    """Calibrations of the right and of the wrong model after the decision on the class; None where there is no model.

    The page's cost under the right model is counted as that of a page which it has not seen.
    """
    taught_right, taught_wrong = (None if judge is None else judge.calibration for judge in (right, wrong))
    cost = 0.0 if right is None else _least_cost(graph, right.model, MatchingParameters())
    other = 0.0 if wrong is None else _least_cost(graph, wrong.model, _QUICK)
    if taught_right is not None and taught_wrong is not None:
        taught_right, taught_wrong = prefer_class((cost, taught_right), (other, taught_wrong))
    elif taught_right is not None and found_class is None:
        taught_right = accept_page(cost, taught_right)
    elif taught_wrong is not None:
        taught_wrong = refuse_page(other, taught_wrong)
    return None if taught_right is None else count_cost(taught_right, cost), taught_wrong


def _changes(
    graph: LayoutGraph, before: _Judge, after: _Judge, found: Labels, verified: Labels
) -> tuple[CostChange, CostChange]:
    """Of the cost of the found and of the verified labelling."""
    of_found, of_verified = (
        CostChange(_cost(graph, before, labels), _cost(graph, after, labels)) for labels in (found, verified)
    )
    return of_found, of_verified


def _cost(graph: LayoutGraph, judge: _Judge, labels: Labels) -> float | None:
    model = judge.model
    if not set(labels) <= set(model.labels):
        return None
    cost = sum(labelling_cost(graph, model, label_indices(labels, model.labels), model.scales))
    return cost + judge.calibration.bias * graph.zones


def _least_cost(graph: LayoutGraph, model: CompiledModel, parameters: MatchingParameters) -> float:
    """Cost a zone of the page's best labelling, as classes are compared by it."""
    matching = match_directly(build_cost_tables(graph, model), parameters)
    return comparable_cost(graph, model, matching.labels) / max(1, graph.zones)
