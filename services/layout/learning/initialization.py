"""Model initialization (5.5, 5.6.1): a layout graph model from a few labelled pages."""

import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from services.layout.content.content_features import ContentFeatures
from services.layout.graph.layout_graph import build_graph
from services.layout.learning.over_segmentation import over_segment
from services.layout.model.estimation import estimate_model
from services.layout.model.held_out import choose_evenly
from services.layout.model.layout_model import Calibration, LayoutModel
from services.layout.model.learning_model import LearningModel, end_learning
from services.layout.model.scale_fitting import fit_scales
from services.layout.model.statistics import LabelledGraph, sample_statistics, total_statistics
from services.layout.page import Page
from services.layout.recognition.classification import calibrate
from services.layout.recognition.page_recognition import RecognitionParameters, comparable_cost, match_graph

MOST_HELD_OUT = 40
"""Samples that are held out in turn to see what pages of the class cost."""
MOST_MATCHED = 2e8
"""Entries of their tables of pairs together: those of 40 pages of 200 zones with 15 labels; larger ones take seconds
each, so that fewer are held out."""


@dataclass(frozen=True, slots=True)
class View:
    """A page and its graph with the labels."""

    page: Page
    labelled: LabelledGraph


Views = Sequence[View]
"""Of one sample: as it was verified, and as segmentation finds it."""


def initialize_model(
    name: str,
    samples: Sequence[Page],
    found: Sequence[Page | None],
    content: ContentFeatures,
) -> LayoutModel:
    """Layout graph model of the class `name` from verified pages, whose zones carry labels and content features.

    Typical values are means, weights inverse variances, relations look-up tables of frequencies, expectations of
    content frequencies, all drawn to what is usual so that one sample is enough to begin. From two samples on,
    the attributes' weights are fitted, and the cost of a page of the class is measured, on pages that were held
    out.

    Every sample is seen in two views, which count as one page: as it was verified, and as segmentation finds it,
    or may find it. `found` has that view for each sample, or None: then one is made up (`over_segmentation`).

    Raises
    ------
    ValueError
        When there is no sample with a zone.
    """
    seen = see_samples(samples, found, content)
    if not seen:
        raise ValueError("a model needs at least one page with zones")
    begun = begin_model(name, seen)
    return end_learning(replace(begun, calibration=calibrate_model(begun, seen)))


def see_samples(
    samples: Sequence[Page], found: Sequence[Page | None], content: ContentFeatures
) -> list[Views]:
    """Both views of every sample that has zones."""
    return [
        _see(sample, other, content) for sample, other in zip(samples, found, strict=True) if sample.zones
    ]


def begin_model(
    name: str, seen: Sequence[Views], labels: Sequence[str | None] | None = None
) -> LearningModel:
    """The model of the samples in `seen`, at least one, with a calibration that is assumed.

    `labels` are those of its nodes, None first (None: those of the samples).
    """
    graphs = [[view.labelled for view in views] for views in seen]
    labels = labels_of(seen) if labels is None else labels
    total = total_statistics(sample_statistics(views, labels) for views in graphs)
    fitted = fit_scales(graphs, total, labels)
    verified = Counter(zone.label for views in seen for zone in views[0].page.zones)
    return LearningModel(
        name=name,
        model=estimate_model(total, labels, fitted.scales),
        statistics=total,
        certainty=fitted.certainty,
        zones=np.array([verified[label] for label in labels], dtype=np.float64),
        samples=len(seen),
        calibration=calibrate([]),
        content_names=graphs[0][0].graph.content_names,
    )


def labels_of(seen: Sequence[Views]) -> tuple[str | None, ...]:
    """Labels of the nodes of a model of these samples, None first."""
    known = {label for views in seen for view in views for label in view.labelled.labels}
    return (None, *sorted(label for label in known if label is not None))


def calibrate_model(begun: LearningModel, seen: Sequence[Views]) -> Calibration:
    """What pages of the class cost, measured on the samples of `begun`, each held out in turn."""
    if len(seen) < 2:
        return calibrate([])
    labels = begun.labels
    work = [sum(len(view.labelled.graph.pairs) for view in views) * len(labels) ** 2 for views in seen]
    costs = []
    for index in choose_evenly(work, MOST_HELD_OUT, MOST_MATCHED):
        others = begun.statistics - sample_statistics([view.labelled for view in seen[index]], labels)
        model = estimate_model(others, labels, begun.model.scales)
        for view in seen[index]:
            graph = view.labelled.graph
            _, matching, _ = match_graph(graph, view.page, model, RecognitionParameters())
            costs.append(comparable_cost(graph, model, matching.labels) / graph.zones)
    return calibrate(costs)


def _see(sample: Page, found: Page | None, content: ContentFeatures) -> Views:
    if found is None or not found.zones:
        # Of the page alone, so that neither the order of samples nor the day changes the model.
        seed = zlib.crc32(repr([zone.box for zone in sample.zones]).encode())
        found = content.measure_page(over_segment(sample, np.random.default_rng(seed)))
    return [
        View(
            page,
            LabelledGraph(build_graph(page, content.names), tuple(zone.label for zone in page.zones)),
        )
        for page in (sample, found)
    ]
