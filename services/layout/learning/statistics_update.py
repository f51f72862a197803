"""Counting a verified page: the typical values, weights, look-up tables and expectations move as its zones tell.

A model that counts page after page is the one that initialization would make of them all, by the same scales: it
needs no earlier page again.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from services.layout.model.compiled_model import SUREST, CompiledModel
from services.layout.model.estimation import estimate_model
from services.layout.model.learning_model import LearningModel, with_labels
from services.layout.model.scale_fitting import (
    ScaleFittingParameters,
    conditional_terms,
    negative_log_likelihood,
)
from services.layout.model.scale_fitting import scale_certainty as certainty_of
from services.layout.model.statistics import LabelledGraph, LabelStatistics, gather_statistics, label_indices


@dataclass(frozen=True, slots=True)
class CountingParameters:
    """Measured on streams of title pages and letters, from models of 1 and 3 samples."""

    memory_pages: float = 200.0
    """More pages fade as new ones come, so that a class may change over time (5.7)."""
    scale_rate: float = 0.5
    """Of the step to the scales under which the page's labels are most probable; whole ones overshoot."""


def count_page(
    learned: LearningModel, page: LabelledGraph, parameters: CountingParameters = CountingParameters()
) -> LearningModel:
    """The model with one page more; labels that it had not become nodes.

    First the scales take a step of Newton's method for the page, which the estimates have not seen yet, as those of
    initialization are fitted on pages that were held out. Then the page joins the sums. What the model's costs
    differ by from their estimate stays.
    """
    learned = with_labels(learned, page.labels)
    scales, certainty = _step_scales(learned, page, parameters)
    kept = min(1.0, (parameters.memory_pages - 1) / max(1.0, float(learned.statistics.pages[0])))
    statistics = _faded(learned.statistics, kept) + gather_statistics(page, learned.labels)
    before = estimate_model(learned.statistics, learned.labels, scales)
    after = estimate_model(statistics, learned.labels, scales)
    zones = learned.zones + np.bincount(
        label_indices(page.labels, learned.labels), minlength=len(learned.labels)
    )
    return replace(
        learned,
        model=moved(learned.model, before, after),
        statistics=statistics,
        certainty=kept * certainty,
        zones=zones,
        samples=learned.samples + 1,
    )


def moved(model: CompiledModel, before: CompiledModel, after: CompiledModel) -> CompiledModel:
    """`model`, which was learned upon the estimate `before`, upon the estimate `after` with its scales."""

    def shift(
        now: NDArray[np.float64], old: NDArray[np.float64], new: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        known = np.isfinite(now) & np.isfinite(old) & np.isfinite(new)
        return np.where(known, now + np.where(known, new - old, 0.0), new)

    def log_odds(expectation: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.log(expectation / (1 - expectation)))

    content = shift(log_odds(model.content), log_odds(before.content), log_odds(after.content))
    return replace(
        after,
        values=shift(model.values, before.values, after.values),
        variances=np.exp(shift(np.log(model.variances), np.log(before.variances), np.log(after.variances))),
        content=np.clip(1 / (1 + np.exp(-content)), SUREST, 1 - SUREST),
        weights=model.weights,
        label_costs=shift(model.label_costs, before.label_costs, after.label_costs),
        relations=shift(model.relations, before.relations, after.relations),
        counts=shift(model.counts, before.counts, after.counts),
    )


def _faded(statistics: LabelStatistics, kept: float) -> LabelStatistics:
    if kept == 1.0:
        return statistics
    return LabelStatistics(*(kept * getattr(statistics, each.name) for each in fields(statistics)))


def _step_scales(
    learned: LearningModel, page: LabelledGraph, parameters: CountingParameters
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Scales after the page and their certainty with it."""
    scales = learned.model.scales
    if not page.labels:
        return scales, learned.certainty
    truth = label_indices(page.labels, learned.labels)
    terms = conditional_terms(page, learned.model, truth)
    _, slope = negative_log_likelihood(scales, terms, truth, scales, 0.0)
    certainty = learned.certainty + certainty_of(scales, terms)
    step = parameters.scale_rate * slope / (ScaleFittingParameters().prior_weight + certainty)
    return np.maximum(scales - step, 0.0), certainty
