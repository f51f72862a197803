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
from scipy.special import logsumexp

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import RELATION_OFFSETS
from services.layout.model.compiled_model import CompiledModel, default_scales
from services.layout.model.cost import node_terms, relation_weight
from services.layout.model.estimation import estimate_model
from services.layout.model.held_out import choose_evenly
from services.layout.model.statistics import LabelledGraph, LabelStatistics, label_indices, sample_statistics


@dataclass(frozen=True, slots=True)
class ScaleFittingParameters:
    """Origins: measured on title pages and letters, where 8 to 50 did equally well for five samples and more."""

    prior_weight: float = 20.0
    """Of the usual weights: inverse of the variance that they have between classes."""
    most_samples: int = 200
    """Largest number of samples, chosen evenly from all; more do not change the weights."""
    most_terms: float = 2e7
    """Costs of zones by label and attribute (8 bytes each, every iteration reads them all): 200 pages of 40 zones with
    15 labels in two views; only larger pages, or more labels, make the samples fewer."""
    most_iterations: int = 60
    folds: int = 5
    """Parts of the samples without which weights are fitted again. Leaving out each sample alone costs more, and a
    fifth of the samples changes weights about as much as their number does between 4 and 5, or 16 and 20."""
    most_refitted: int = 40
    """Most samples for which weights are fitted again: of more, one sample has no noticeable part in the weights."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedScales:
    """Weights of all attributes (K,), and how sure each is: `certainty` (K,) is the pages' part of its curvature."""

    scales: NDArray[np.float64]
    certainty: NDArray[np.float64]


def fit_scales(
    samples: Sequence[Sequence[LabelledGraph]],
    total: LabelStatistics,
    labels: Sequence[str | None],
    parameters: ScaleFittingParameters = ScaleFittingParameters(),
) -> FittedScales:
    """Weights of all attributes, in the order of `scale_names`.

    A sample is a page in one view or several (`initialization`), all of which are held out together; `total` are the
    sums over all samples (`sample_statistics`). Fewer than two samples leave the usual weights: nothing was held out.
    """
    usual = default_scales(samples[0][0].graph.content_names if samples else ())
    if len(samples) < 2:
        return FittedScales(usual, np.zeros_like(usual))
    terms, truth, _ = _held_out_terms(samples, total, labels, usual, parameters)
    scales = most_probable_scales(terms, truth, usual, parameters)
    return FittedScales(scales, scale_certainty(scales, terms))


def fit_scales_without(
    samples: Sequence[Sequence[LabelledGraph]],
    total: LabelStatistics,
    labels: Sequence[str | None],
    scales: NDArray[np.float64],
    parameters: ScaleFittingParameters = ScaleFittingParameters(),
) -> list[NDArray[np.float64]]:
    """For each sample weights (K,) that were not fitted to its labels, as those of a later page are not.

    Otherwise as `fit_scales`, whose weights are `scales`; one sample, and many, keep these.
    """
    folds = min(parameters.folds, len(samples))
    if not 2 <= len(samples) <= parameters.most_refitted:
        return [scales] * len(samples)
    usual = default_scales(samples[0][0].graph.content_names)
    terms, truth, owner = _held_out_terms(samples, total, labels, usual, parameters)
    parts = [owner % folds != fold for fold in range(folds)]
    without = [most_probable_scales(terms[part], truth[part], usual, parameters) for part in parts]
    return [without[index % folds] for index in range(len(samples))]


def _held_out_terms(
    samples: Sequence[Sequence[LabelledGraph]],
    total: LabelStatistics,
    labels: Sequence[str | None],
    usual: NDArray[np.float64],
    parameters: ScaleFittingParameters,
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
    """Terms (N, L, K) of zones by models without their samples, true labels (N,), and indices (N,) of their samples."""
    work = [sum(view.graph.zones for view in views) * len(labels) * len(usual) for views in samples]
    terms, truth, owner = [], [], []
    for index in choose_evenly(work, parameters.most_samples, parameters.most_terms):
        model = estimate_model(total - sample_statistics(samples[index], labels), labels, usual)
        for view in samples[index]:
            given = label_indices(view.labels, labels)
            terms.append(conditional_terms(view, model, given))
            truth.append(given)
            owner.append(np.full(len(given), index))
    return np.concatenate(terms), np.concatenate(truth), np.concatenate(owner)


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
    graph = page.graph
    upper, lower = graph.pairs.T
    terms = np.zeros((graph.zones, len(model.labels), len(RELATIONS)))
    for position in range(len(RELATIONS)):
        descriptor = graph.relations[:, position] + RELATION_OFFSETS[position]
        np.add.at(terms[:, :, position], upper, model.relations[:, given[lower], descriptor].T)
        np.add.at(terms[:, :, position], lower, model.relations[given[upper], :, descriptor])
    return terms


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
    rows = np.arange(len(truth))
    score = -(terms @ scales)
    total = logsumexp(score, axis=1)
    probability = np.exp(score - total[:, None])
    away = scales - usual
    value = (total - score[rows, truth]).sum() + 0.5 * prior_weight * (away @ away)
    slope = terms[rows, truth].sum(axis=0) - np.tensordot(probability, terms, axes=2) + prior_weight * away
    return float(value), slope


def scale_certainty(scales: NDArray[np.float64], terms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Second derivatives (K,) of the zones' part of `negative_log_likelihood`: variances of their terms."""
    score = -(terms @ scales)
    probability = np.exp(score - logsumexp(score, axis=1)[:, None])[:, None, :]
    mean = (probability @ terms)[:, 0]
    # A difference of large numbers may miss zero by a rounding error.
    return np.asarray(np.maximum((probability @ terms**2)[:, 0] - mean**2, 0.0).sum(axis=0))


def most_probable_scales(
    terms: NDArray[np.float64],
    truth: NDArray[np.intp],
    usual: NDArray[np.float64],
    parameters: ScaleFittingParameters,
) -> NDArray[np.float64]:
    """The scales, none negative, of least `negative_log_likelihood`."""
    fitted = minimize(
        negative_log_likelihood,
        usual,
        args=(terms, truth, usual, parameters.prior_weight),
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, None)] * len(usual),
        options={"maxiter": parameters.most_iterations},
    )
    return np.asarray(fitted.x)
