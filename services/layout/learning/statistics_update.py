"""Sufficient-statistics update: adds a verified page to the sums of a model, and estimates the model again.

After updates with several pages a model equals the model that initialization makes from the same pages and scales.
Earlier pages are not needed. Learner "counting" of the HTTP contract does this alone.
"""

from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from services.layout.model.compiled_model import SUREST, CompiledModel
from services.layout.model.estimation import estimate_model
from services.layout.model.learning_model import LearningModel, with_labels
from services.layout.model.scale_fitting import (
    PRIOR_WEIGHT,
    conditional_terms,
    negative_log_likelihood,
)
from services.layout.model.scale_fitting import scale_certainty as certainty_of
from services.layout.model.statistics import LabelledGraph, LabelStatistics, label_indices, sample_statistics

MOST_PAGES = 200.0
"""Largest number of pages in the sums. Beyond it older pages lose weight, so that a class may change (5.7)."""
SCALE_RATE = 0.5
"""Share of the Newton step to the scales under which the page's labels are most probable; whole steps overshoot."""


def update_statistics(
    learned: LearningModel,
    page: LabelledGraph,
    found: LabelledGraph | None = None,
    scale_rate: float = SCALE_RATE,
) -> LearningModel:
    """The model after one more page; new labels become nodes. `found` is a second view of the same page.

    First the scales take a step of Newton's method for the page. The estimates have not seen the page yet, just as
    initialization fits scales on pages that were held out. Then the page is added to the sums. Differences between
    the model's costs and their estimate, which were learned from errors, stay.
    """
    learned = with_labels(learned, page.labels)
    scales, certainty = _step_scales(learned, page, scale_rate)
    kept = min(1.0, (MOST_PAGES - 1) / max(1.0, float(learned.statistics.pages[0])))
    views = [page] if found is None else [page, found]
    statistics = _faded(learned.statistics, kept) + sample_statistics(views, learned.labels)
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
    """The estimate `after` plus the differences of `model` from the estimate `before`, which it has learned."""

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
    learned: LearningModel, page: LabelledGraph, scale_rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Scales after the page and their certainty with it."""
    scales = learned.model.scales
    if not page.labels:
        return scales, learned.certainty
    truth = label_indices(page.labels, learned.labels)
    terms = conditional_terms(page, learned.model, truth)
    _, slope = negative_log_likelihood(scales, terms, truth, scales, 0.0)
    certainty = learned.certainty + certainty_of(scales, terms)
    step = scale_rate * slope / (PRIOR_WEIGHT + certainty)
    return np.maximum(scales - step, 0.0), certainty
