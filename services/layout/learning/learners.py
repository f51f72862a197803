"""Algorithms by which a model learns from one verified page; a setting of the model selects one.

- "passive-aggressive": sufficient-statistics update, then errors and small margins are corrected
  (`passive_aggressive`).
- "counting": sufficient-statistics update alone (`statistics_update`).
- "error-correction": the dissertation's update (`error_correction`): only errors change the model.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from services.contract.layout_learning import DEFAULT_LEARNER, Learner
from services.layout.graph.layout_graph import LayoutGraph
from services.layout.learning.error_correction import correct_errors
from services.layout.learning.passive_aggressive import learn_by_margin
from services.layout.learning.statistics_update import update_statistics
from services.layout.matching import MatchingParameters, match_directly
from services.layout.model.cost import build_cost_tables
from services.layout.model.learning_model import LearningModel, with_labels
from services.layout.model.statistics import LabelledGraph, label_indices

MOST_LESSONS = 4
"""A page that the model still labels wrongly after a lesson is learned again, so often in all: of 89 wrong
values of receipts one lesson left 42 on the very page that was corrected, four leave 21. More blind to other pages."""


def learn_page(
    learned: LearningModel, page: LabelledGraph, learner: Learner, found: LabelledGraph | None = None
) -> LearningModel:
    """The model after learning from a new page; new labels become nodes.

    `found` is the same page in the zones that were found, where a person drew others: both views count as one page, as
    those of a sample do, and the errors of both are corrected.
    """
    views = [page] if found is None else [page, found]
    once = _one_lesson(learned, views, learner)
    learned = once
    for _ in range(MOST_LESSONS - 1 if learner == DEFAULT_LEARNER else 0):
        if not any(wrong_zones(learned, view) for view in views):
            break
        learned = _one_lesson(learned, views, learner)
    # The page was seen once, whatever it weighs.
    return replace(learned, samples=once.samples, zones=once.zones)


def _one_lesson(learned: LearningModel, views: Sequence[LabelledGraph], learner: Learner) -> LearningModel:
    """The model after the views of a page were counted and their errors corrected, once."""
    if learner != "error-correction":
        learned = update_statistics(learned, views[0], found=views[1] if len(views) > 1 else None)
    learned = with_labels(learned, views[0].labels)
    for view in views:
        learned, _ = correct_page(learned, view, learner)
    return learned


def correct_page(learned: LearningModel, page: LabelledGraph, learner: Learner) -> tuple[LearningModel, bool]:
    """The model after its errors on a page were corrected, and whether it changed: one step of a round.

    The page is in the statistics already, and the model has all its labels.
    """
    truth = label_indices(page.labels, learned.labels)
    if not len(truth) or learner == "counting":
        return learned, False
    if learner == "passive-aggressive":
        model, changed = learn_by_margin(learned.model, page.graph, truth)
        return (learned.with_model(model), True) if changed else (learned, False)
    found = match_page(learned, page.graph)
    if np.array_equal(found, truth):
        return learned, False
    return learned.with_model(correct_errors(learned.model, page.graph, truth, found)), True


def match_page(learned: LearningModel, graph: LayoutGraph) -> NDArray[np.intp]:
    """Labels (N,) of least cost, as indices of the model's nodes."""
    return match_directly(build_cost_tables(graph, learned.model), MatchingParameters()).labels


def wrong_zones(learned: LearningModel, page: LabelledGraph) -> int:
    """Number of zones of a page that the model labels wrongly, including zones whose label it does not have."""
    found = match_page(learned, page.graph)
    return sum(learned.labels[index] != label for index, label in zip(found, page.labels, strict=True))
