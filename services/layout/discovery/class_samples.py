"""Samples of a class, and the cost of each sample by models that were made without it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.contract.layout_models import MOST_COMPARED_SAMPLES
from services.layout.graph.layout_graph import LayoutGraph, build_graph
from services.layout.matching import NO_PROOF, match_directly
from services.layout.model.compiled_model import CompiledModel, comparable_scales
from services.layout.model.cost import build_cost_tables
from services.layout.model.estimation import estimate_model
from services.layout.model.held_out import choose_evenly
from services.layout.model.statistics import (
    LabelledGraph,
    LabelStatistics,
    sample_statistics,
    total_statistics,
)
from services.layout.page import Page
from services.layout.recognition.page_recognition import comparable_cost

FEWEST_PAGES = 3
"""Of a class, a part of one, or a new one. Two can be alike by chance: among 50 single pages of different classes there
is such a pair, and models of two samples do not separate letters from memos."""
MOST_MATCHED = 5e7
"""Largest number of table entries of pairs for the samples of a class, 10 ns each; it limits samples with many
zones."""


@dataclass(frozen=True, slots=True, eq=False)
class ClassSamples:
    """The samples of a class, each in one or two views, and their statistics for each label.

    `labels` begin with None, as in every model; `statistics` has the sums of each sample, `total` those of all.
    """

    name: str
    samples: tuple[tuple[LabelledGraph, ...], ...]
    labels: tuple[str | None, ...]
    statistics: tuple[LabelStatistics, ...]
    total: LabelStatistics

    @property
    def content_names(self) -> tuple[str, ...]:
        return self.samples[0][0].graph.content_names

    def verified(self) -> list[LayoutGraph]:
        """Graphs of the samples as people verified them."""
        return [views[0].graph for views in self.samples]

    def model(self, statistics: LabelStatistics | None = None) -> CompiledModel:
        """The model of all samples, or of those in `statistics`, with the default weights, which all classes share."""
        total = self.total if statistics is None else statistics
        return estimate_model(total, self.labels, comparable_scales(self.content_names))


def gather_samples(
    name: str, samples: Sequence[tuple[Page, Page | None]], content_names: Sequence[str]
) -> tuple[ClassSamples, tuple[int, ...]]:
    """The samples of a class with their statistics, and the indices (rising) of the chosen samples.

    Each sample is the verified page with its content features, and the page in the zones that segmentation found
    (None where it is not known).

    Raises
    ------
    ValueError
        When no sample has a zone.
    """
    printed = [index for index, (verified, _) in enumerate(samples) if verified.zones]
    if not printed:
        raise ValueError("a class needs at least one page with zones")
    views = [_views(*samples[index], content_names) for index in printed]
    labels = (
        None,
        *sorted({label for each in views for view in each for label in view.labels if label is not None}),
    )
    work = [sum(len(view.graph.pairs) for view in each) * len(labels) ** 2 for each in views]
    chosen = choose_evenly(work, MOST_COMPARED_SAMPLES, MOST_MATCHED)
    taken = tuple(views[index] for index in chosen)
    statistics = tuple(sample_statistics(each, labels) for each in taken)
    gathered = ClassSamples(name, taken, labels, statistics, total_statistics(statistics))
    return gathered, tuple(printed[index] for index in chosen)


def _views(verified: Page, found: Page | None, content_names: Sequence[str]) -> tuple[LabelledGraph, ...]:
    pages = [page for page in (verified, found) if page is not None and page.zones]
    return tuple(
        LabelledGraph(build_graph(page, content_names), tuple(zone.label for zone in page.zones))
        for page in pages
    )


@dataclass(frozen=True, slots=True, eq=False)
class SampleCost:
    """Cost a zone of a sample by a model, the mean of its views, and the model's labels (indices) of its first view."""

    cost: float
    labels: NDArray[np.intp]


def match_sample(views: Sequence[LabelledGraph], model: CompiledModel) -> SampleCost:
    """Least cost of a sample under a model, over all labellings; the verified labels are not used."""
    found = [match_directly(build_cost_tables(view.graph, model), NO_PROOF).labels for view in views]
    costs = [
        comparable_cost(view.graph, model, labels) / view.graph.zones
        for view, labels in zip(views, found, strict=True)
    ]
    return SampleCost(float(np.mean(costs)), found[0])


def held_out_costs(samples: ClassSamples) -> NDArray[np.float64]:
    """Cost a zone (S,) of every sample by a model of the other samples; S >= 2."""
    return np.array(
        [
            match_sample(views, samples.model(samples.total - own)).cost
            for views, own in zip(samples.samples, samples.statistics, strict=True)
        ]
    )
