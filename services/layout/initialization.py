"""Model initialization (5.5, 5.6.1): a layout graph model from a few labelled pages."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from models.layout_graph import LayoutModel, Page
from services.layout.classification import calibrate
from services.layout.estimation import estimate_model, name_parts
from services.layout.graph import build_graph
from services.layout.recognition import RecognitionParameters, comparable_cost, match_graph
from services.layout.scale_fitting import fit_scales
from services.layout.statistics import LabelledGraph, LabelStatistics, gather_statistics, total_statistics

MOST_HELD_OUT = 40
"""Pages that are held out in turn to see what pages of the class cost."""


def initialize_model(name: str, samples: Sequence[Page], content_names: Sequence[str]) -> LayoutModel:
    """Layout graph model of the class `name` from verified pages, whose zones carry labels and content features.

    Typical values are means, weights inverse variances, relations look-up tables of frequencies, expectations of
    content frequencies, all drawn to what is usual so that one sample is enough to begin. From two samples on,
    the attributes' weights are fitted, and the cost of a page of the class is measured, on pages that were held
    out.

    Raises
    ------
    ValueError
        When there is no sample with a zone.
    """
    samples = [page for page in samples if page.zones]
    if not samples:
        raise ValueError("a model needs at least one page with zones")
    pages = [
        LabelledGraph(build_graph(page, content_names), tuple(zone.label for zone in page.zones))
        for page in samples
    ]
    labels = (None, *sorted({label for page in pages for label in page.labels if label is not None}))
    statistics = [gather_statistics(page, labels) for page in pages]
    total = total_statistics(statistics)
    scales = fit_scales(pages, statistics, labels)
    costs = _held_out_costs(samples, pages, statistics, labels, scales)
    return name_parts(
        estimate_model(total, labels, scales),
        name,
        len(pages),
        total.zones,
        pages[0].graph.content_names,
        calibrate(costs),
    )


def _held_out_costs(
    samples: Sequence[Page],
    pages: Sequence[LabelledGraph],
    statistics: Sequence[LabelStatistics],
    labels: Sequence[str | None],
    scales: NDArray[np.float64],
) -> list[float]:
    """Cost a zone of pages, each matched with the model of all the others."""
    if len(pages) < 2:
        return []
    total = total_statistics(statistics)
    chosen = np.unique(np.linspace(0, len(pages) - 1, min(len(pages), MOST_HELD_OUT)).astype(int))
    costs = []
    for index in chosen:
        graph = pages[index].graph
        model = estimate_model(total - statistics[index], labels, scales)
        _, matching, _ = match_graph(graph, samples[index], model, RecognitionParameters())
        costs.append(comparable_cost(graph, model, matching.labels) / graph.zones)
    return costs
