"""What the learning benchmarks share: pages as models learn them, the learners, and how their figures are told."""

from collections.abc import Mapping, Sequence
from typing import get_args

from benchmarks.layout.learning_curve import labelled_sets
from benchmarks.layout.specimens import Specimen
from services.contract.layout_learning import Learner
from services.layout.graph.layout_graph import KIND_FEATURES, build_graph
from services.layout.learning.initialization import Views, begin_model, make_views
from services.layout.learning.learners import match_page
from services.layout.model.layout_model import LayoutModel
from services.layout.model.learning_model import LearningModel, begin_learning
from services.layout.model.statistics import LabelledGraph
from services.layout.page import Page
from services.layout.pipeline import content_features

LEARNERS: tuple[Learner, ...] = get_args(Learner)
NONE, ANEW = "no learning", "initialized anew"
COLOURS = {
    "passive-aggressive": "#4878a8",
    "counting": "#50a060",
    "error-correction": "#c03030",
    NONE: "#888888",
    ANEW: "#c09030",
}
CLASS = "class"
"""Name of a model that is alone."""


def see(pages: Sequence[Page]) -> list[Views]:
    """Both views of each sample, as initialization learns from them."""
    return make_views(pages, [None] * len(pages), content_features())


def begin(seen: Sequence[Views]) -> LearningModel:
    """The model of these samples (round 0), ready to learn; it is not calibrated, as one class needs no decision."""
    return begin_model(CLASS, seen)


def ready(model: LayoutModel) -> LearningModel:
    """A stored model ready to learn."""
    return begin_learning(model, (*content_features().names, *KIND_FEATURES))


def labelled(page: Page) -> LabelledGraph:
    """A page as feedback teaches it."""
    return LabelledGraph(
        build_graph(page, content_features().names), tuple(zone.label for zone in page.zones)
    )


def found_labels(learned: LearningModel, page: LabelledGraph) -> tuple[str | None, ...]:
    """Labels that the model finds, the true ones unseen."""
    return tuple(learned.labels[index] for index in match_page(learned, page.graph))


def chosen_sets(specimens: Sequence[Specimen], names: Sequence[str]) -> dict[str, list[Page]]:
    """Those of `labelled_sets` that have these names, true zones with at least one zone a page."""
    sets: Mapping[str, list[Page]] = labelled_sets(specimens)
    chosen = {name: [page for page in sets.get(name, ()) if page.zones] for name in names}
    return {name: pages for name, pages in chosen.items() if len(pages) > 1}


def drop_percent(before: float, after: float) -> float:
    """By how much an error fell, percent of what it was; NaN of none."""
    return 100 * (1 - after / before) if before else float("nan")


def verdict(met: bool | None) -> str:
    """Of a requirement; None where nothing was measured."""
    return "-" if met is None else "yes" if met else "NO"
