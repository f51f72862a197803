"""What a person's correction of one page makes of the models that it concerns (5.2, 5.5)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from models.layout_graph import DEFAULT_LEARNER, Calibration, LayoutModel, Learner, Page
from services.layout.cost import build_cost_tables, labelling_cost
from services.layout.graph import LayoutGraph, build_graph
from services.layout.learning.class_decisions import accept_page, count_cost, prefer_class, refuse_page
from services.layout.learning.learners import learn_page, match_page
from services.layout.learning.state import LearningModel, begin_learning, end_learning, with_labels
from services.layout.matching import MatchingParameters, match_directly
from services.layout.recognition import comparable_cost
from services.layout.statistics import LabelledGraph, label_indices

Labels = tuple[str | None, ...]

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
    right, wrong = (
        begin_learning(models[name], graph.content_names) if name is not None and name in models else None
        for name in (said.verified_class, wrong_class)
    )
    labels = _all_labels(said, graph, right)
    accepting, refusing = _decide(graph, right, wrong, said.found_class)
    learned: dict[str, LearnedModel] = {}
    if right is not None and accepting is not None:
        learner = learners.get(right.name, DEFAULT_LEARNER)
        after = learn_page(replace(right, calibration=accepting), LabelledGraph(graph, labels), learner)
        learned[right.name] = _told(graph, right, after, said.found, labels)
    if wrong is not None and refusing is not None:
        after = replace(wrong, calibration=refusing)
        learned[wrong.name] = _told(graph, wrong, after, said.found, labels)
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


def _decide(
    graph: LayoutGraph, right: LearningModel | None, wrong: LearningModel | None, found_class: str | None
) -> tuple[Calibration | None, Calibration | None]:
    """Calibrations of the right and of the wrong model after the decision on the class; None where there is no model.

    The page's cost under the right model is counted as that of a page which it has not seen.
    """
    taught_right, taught_wrong = (None if model is None else model.calibration for model in (right, wrong))
    cost = 0.0 if right is None else _least_cost(graph, right)
    other = 0.0 if wrong is None else _least_cost(graph, wrong)
    if taught_right is not None and taught_wrong is not None:
        taught_right, taught_wrong = prefer_class((cost, taught_right), (other, taught_wrong))
    elif taught_right is not None and found_class is None:
        taught_right = accept_page(cost, taught_right)
    elif taught_wrong is not None:
        taught_wrong = refuse_page(other, taught_wrong)
    return None if taught_right is None else count_cost(taught_right, cost), taught_wrong


def _told(
    graph: LayoutGraph, before: LearningModel, after: LearningModel, found: Labels, verified: Labels
) -> LearnedModel:
    return LearnedModel(
        end_learning(after),
        *(
            CostChange(_cost(graph, before, labels), _cost(graph, after, labels))
            for labels in (found, verified)
        ),
    )


def _cost(graph: LayoutGraph, learned: LearningModel, labels: Labels) -> float | None:
    if not set(labels) <= set(learned.labels):
        return None
    model = learned.model
    cost = sum(labelling_cost(graph, model, label_indices(labels, model.labels), model.scales))
    return cost + learned.calibration.bias * graph.zones


def _least_cost(graph: LayoutGraph, learned: LearningModel) -> float:
    """Cost a zone of the page's best labelling, as classes are compared by it."""
    return comparable_cost(graph, learned.model, match_page(learned, graph)) / max(1, graph.zones)
