"""Fitting of the attributes' weights to samples of a class.

Weights by inverse variances (5.6.1) assume independent attributes. Positions and sizes are correlated, and their sum
would dominate the other attributes. One factor for each attribute, shared by all components, corrects this. The factors
are those under which each zone's true label, given those of the other zones, is most probable (pseudo-likelihood:
Besag, The Statistician 24, 1975), drawn to the usual ones. Every page is judged by a model in which it has no part. The
problem is convex, so it has one answer.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse import coo_array
from scipy.special import softmax

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import RELATION_OFFSETS
from services.layout.model.compiled_model import CompiledModel, default_scales
from services.layout.model.cost import node_terms, relation_weight
from services.layout.model.estimation import estimate_model
from services.layout.model.held_out import choose_evenly
from services.layout.model.statistics import LabelledGraph, LabelStatistics, label_indices, sample_statistics

PRIOR_WEIGHT = 20.0
"""Of the usual weights: inverse of the variance that they have between classes."""
_MOST_SAMPLES = 200
"""Largest number of samples, chosen evenly from all; more do not change the weights."""
_MOST_TERMS = 2e7
"""Costs of zones by label and attribute (8 bytes each, every iteration reads them all): 200 pages of 40 zones with
15 labels in two views; only larger pages, or more labels, make the samples fewer."""
_MOST_ITERATIONS = 60
_LEAST_GAIN = 1e-6
"""Of the cost: refitting ends where a step cannot gain more. Weights are then within 0.003 of the best."""
FOLDS = 5
"""Parts of the samples without which weights are fitted again. Leaving out each sample alone costs more, and a
fifth of the samples changes weights about as much as their number does between 4 and 5, or 16 and 20."""
_MOST_REFITTED = 40
"""Most samples for which weights are fitted again: of more, one sample has no noticeable part in the weights."""


_NONE = np.zeros(0, np.intp)
_LEAST_SHARE = 1e-4
"""Of the gain that the slope promises, which a step must keep (Armijo's rule)."""
_IMPROBABLE = 1e-3
"""Labels that are less probable than this share of the most probable one hardly change the curvature."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedScales:
    """Weights of all attributes (K,), and how sure each is: `certainty` (K,) is the pages' part of its curvature."""

    scales: NDArray[np.float64]
    certainty: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutTerms:
    """What weights are fitted to: `terms` (N, L, K) of zones (`conditional_terms`) by models without their samples.

    `truth` (N,) are the true labels, `owner` (N,) the indices of the samples among all `samples`, `usual` (K,) the
    weights that are usual. No zones where there are fewer than two samples: nothing was held out.
    """

    terms: NDArray[np.float64]
    truth: NDArray[np.intp]
    owner: NDArray[np.intp]
    samples: int
    usual: NDArray[np.float64]


def hold_out_terms(
    samples: Sequence[Sequence[LabelledGraph]],
    total: LabelStatistics,
    labels: Sequence[str | None],
) -> HeldOutTerms:
    """Terms of the zones of all samples, at most `_MOST_SAMPLES`.

    A sample is a page in one view or several (`initialization`), all of which are held out together; `total` are the
    sums over all samples (`sample_statistics`).
    """
    usual = default_scales(samples[0][0].graph.content_names if samples else ())
    terms, truth, owner = [np.zeros((0, len(labels), len(usual)))], [_NONE], [_NONE]
    work = [sum(view.graph.zones for view in views) * len(labels) * len(usual) for views in samples]
    if len(samples) > 1:
        for index in choose_evenly(work, _MOST_SAMPLES, _MOST_TERMS):
            model = estimate_model(total - sample_statistics(samples[index], labels), labels, usual)
            for view in samples[index]:
                given = label_indices(view.labels, labels)
                terms.append(conditional_terms(view, model, given))
                truth.append(given)
                owner.append(np.full(len(given), index))
    return HeldOutTerms(
        np.concatenate(terms), np.concatenate(truth), np.concatenate(owner), len(samples), usual
    )


def fit_scales(held_out: HeldOutTerms) -> FittedScales:
    """Weights of all attributes, in the order of `scale_names`; without zones the usual ones."""
    scales = most_probable_scales(held_out.terms, held_out.truth, held_out.usual)
    return FittedScales(scales, scale_certainty(scales, held_out.terms))


def fit_scales_without(held_out: HeldOutTerms, scales: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """For each sample weights (K,) that were not fitted to its labels, as those of a later page are not.

    Otherwise as `fit_scales`, whose weights are `scales`; one sample, and many, keep these.
    """

    count = held_out.samples
    folds = min(FOLDS, count)
    if not 2 <= count <= _MOST_REFITTED:
        return [scales] * count
    without = list(_refitted(held_out, scales, held_out.owner % folds))
    return [without[index % folds] for index in range(count)]


def _refitted(
    held_out: HeldOutTerms,
    scales: NDArray[np.float64],
    fold: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Weights (F, K) most probable for the zones outside each fold; `fold` (N,) is that of each zone.

    Projected Newton steps from the weights of all zones, which are near: the curvature there serves for all steps, and
    one pass over the terms serves for all folds.
    """
    terms, truth, usual, prior = held_out.terms, held_out.truth, held_out.usual, PRIOR_WEIGHT
    parts = np.arange(fold.max() + 1)
    outside = fold != parts[:, None]
    inside = np.stack([_curvature(scales, terms[fold == part]) for part in parts])
    curvature = prior * np.eye(len(usual)) + inside.sum(axis=0) - inside
    found = np.repeat(scales[None], len(parts), axis=0)
    value, slope = _penalized(found, terms, truth, outside, usual, prior)
    length = np.ones(len(parts))
    for _ in range(_MOST_ITERATIONS):
        step = np.zeros_like(found)
        for part, free in enumerate((found > 0) | (slope < 0)):
            step[part, free] = np.linalg.solve(curvature[part][np.ix_(free, free)], slope[part, free])
        tried = np.maximum(found - length[:, None] * step, 0.0)
        expected = (slope * (found - tried)).sum(axis=1)
        if np.all(expected < _LEAST_GAIN * (1.0 + value)):
            break
        tried_value, tried_slope = _penalized(tried, terms, truth, outside, usual, prior)
        better = tried_value <= value - _LEAST_SHARE * expected
        found[better], value[better], slope[better] = tried[better], tried_value[better], tried_slope[better]
        length = np.where(better, 1.0, length / 2)
    return found


def conditional_terms(
    page: LabelledGraph, model: CompiledModel, given: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Costs (N, L, K), not yet weighted by scales, of another label for one zone while all others keep the `given`."""
    graph = page.graph
    return np.concatenate(
        [
            node_terms(graph, model),
            _relation_terms(page, model, given) * relation_weight(graph.zones),
            _count_terms(model, given)[:, :, None],
        ],
        axis=2,
    )


def _relation_terms(
    page: LabelledGraph, model: CompiledModel, given: NDArray[np.intp]
) -> NDArray[np.float64]:
    graph, pairs = page.graph, len(page.graph.pairs)
    upper, lower = graph.pairs.T
    descriptors = graph.relations + RELATION_OFFSETS[:-1]
    of_upper = model.relations.transpose(1, 2, 0)[given[lower][:, None], descriptors]
    of_lower = model.relations.transpose(0, 2, 1)[given[upper][:, None], descriptors]
    columns = len(RELATIONS) * len(model.labels)
    terms = np.zeros((graph.zones, columns))
    for zone, costs in ((upper, of_upper), (lower, of_lower)):
        is_part = coo_array((np.ones(pairs), (zone, np.arange(pairs))), shape=(graph.zones, pairs))
        terms += is_part.tocsr() @ costs.reshape(pairs, columns)
    return terms.reshape(graph.zones, len(RELATIONS), len(model.labels)).transpose(0, 2, 1)


def _count_terms(model: CompiledModel, given: NDArray[np.intp]) -> NDArray[np.float64]:
    labels = np.arange(len(model.labels))
    counts = np.bincount(given, minlength=len(labels))
    others = counts - (given[:, None] == labels)
    last = model.counts.shape[1] - 1
    return np.asarray(
        model.counts[labels, np.minimum(others + 1, last)] - model.counts[labels, np.minimum(others, last)]
    )


def negative_log_likelihood(
    scales: NDArray[np.float64],
    terms: NDArray[np.float64],
    truth: NDArray[np.intp],
    usual: NDArray[np.float64],
    prior_weight: float,
) -> tuple[float, NDArray[np.float64]]:
    """What the `scales` (K,) make least, and its slope (K,): convex.

    `terms` (N, L, K) are unweighted costs of zones' labels (`conditional_terms`), `truth` (N,) the true ones.
    """
    every = np.ones((1, len(truth)), dtype=np.bool_)
    value, slope = _penalized(scales[None], terms, truth, every, usual, prior_weight)
    return float(value[0]), slope[0]


def _penalized(
    scales: NDArray[np.float64],
    terms: NDArray[np.float64],
    truth: NDArray[np.intp],
    counted: NDArray[np.bool_],
    usual: NDArray[np.float64],
    prior_weight: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`negative_log_likelihood` (F,) of several `scales` (F, K) and its slopes (F, K), each of its `counted` (F, N)."""
    zones, labels, attributes = terms.shape
    flat, rows = terms.reshape(zones * labels, attributes), np.arange(zones)
    costs = (scales @ flat.T).reshape(len(scales), zones, labels)
    least = costs.min(axis=2, keepdims=True)
    probability = np.exp(least - costs)
    sums = probability.sum(axis=2)
    of_zones = np.log(sums) - least[:, :, 0] + costs[:, rows, truth]
    probability *= (counted / sums)[:, :, None]
    away = scales - usual
    value = (of_zones * counted).sum(axis=1) + 0.5 * prior_weight * (away**2).sum(axis=1)
    expected = probability.reshape(len(scales), zones * labels) @ flat
    return value, counted @ terms[rows, truth] - expected + prior_weight * away


def _probabilities(scales: NDArray[np.float64], terms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the labels of zones, (N, L)."""
    return np.asarray(softmax(-(terms @ scales), axis=1))


def _curvature(scales: NDArray[np.float64], terms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Second derivatives (K, K) of the zones' part of `negative_log_likelihood`, without improbable labels."""
    probability = _probabilities(scales, terms)
    probability[probability < _IMPROBABLE * probability.max(axis=1, keepdims=True)] = 0.0
    probability /= probability.sum(axis=1, keepdims=True)
    mean = (probability[:, None, :] @ terms)[:, 0]
    likely = probability > 0
    weighted = terms[likely] * np.sqrt(probability[likely])[:, None]
    return np.asarray(weighted.T @ weighted - mean.T @ mean)


def scale_certainty(scales: NDArray[np.float64], terms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Second derivatives (K,) of the zones' part of `negative_log_likelihood`: variances of their terms."""
    probability = _probabilities(scales, terms)[:, None, :]
    mean = (probability @ terms)[:, 0]
    # A difference of large numbers may miss zero by a rounding error.
    return np.asarray(np.maximum((probability @ terms**2)[:, 0] - mean**2, 0.0).sum(axis=0))


def most_probable_scales(
    terms: NDArray[np.float64],
    truth: NDArray[np.intp],
    usual: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The scales, none negative, of least `negative_log_likelihood`."""
    fitted = minimize(
        negative_log_likelihood,
        usual,
        args=(terms, truth, usual, PRIOR_WEIGHT),
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, None)] * len(usual),
        options={"maxiter": _MOST_ITERATIONS},
    )
    return np.asarray(fitted.x)
