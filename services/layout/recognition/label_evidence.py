"""How probably a label is right, by what models of all classes have in common.

The costs of a match are log likelihood ratios, from which the probability of each label follows. That is too sure where
attributes say the same thing several times over, and it compares labels only: a zone like no zone of the samples has a
most probable label, too. So log odds of being right are a logistic regression (Platt's scaling with more than one
input) on the log odds of the label among all labels, on how much better the label explains the zone than a zone of any
page is explained, and on what is known of the page and of the model.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from services.layout.matching import own_costs, zone_costs
from services.layout.matching.cost_tables import CostTables

EVIDENCE_FEATURES = (
    "constant",
    "log-odds",
    "own",
    "pairs",
    "zones",
    "samples",
    "log-odds by samples",
    "log-odds by own",
)
"""What is measured of a label; `label_features` has their order. The last two are products: log odds say more by a
model of more samples, and of a zone that is like those of the samples."""


@dataclass(frozen=True, slots=True)
class LabelEvidence:
    """Log odds for each of `EVIDENCE_FEATURES`, and the bounds beyond which a feature counts as its bound.

    `most_log_odds`: a label that is more probable among all labels is hardly more often right. `own_costs`: a zone
    that costs less by itself is hardly more often labelled right.
    """

    weights: tuple[float, ...]
    most_log_odds: float
    own_costs: tuple[float, float]


READ: Final = LabelEvidence((0.527, 0.055, -0.2, -0.302, -0.606, 0.122, 0.09, -0.036), 6.0, (-12.0, 3.0))
"""Of pages whose text was read: a logistic regression on the zones that segmentation found on the pages of six classes
(title pages of three publications, real letters, memos, fax sheets), by models of 1 to 50 samples; each class and
number of samples weighs the same. Without any one of the classes the weights are nearly the same. A sixth of the zones
cost less than the bound: 99.8 % of their labels are right."""

UNREAD: Final = LabelEvidence((-1.522, 0.415, -0.435, -0.349, 0.0, 0.239, 0.0, 0.0), 12.0, (-3.0, 3.0))
"""Of pages whose text was not read: learned on real letters, memos, fax sheets and title pages of three publications
without their texts. A zone has fewer attributes then: its own cost only tells that it is strange, and log odds beyond 6
still say something. The number of zones is left out: with it, classes that took no part are believed less well."""

PAIR_COSTS: Final = (-5.0, 2.0)
"""Costs of pairs beyond these bounds count as these."""


MOST_AWAY = 2.0
"""Log odds between a zone's label and another one that is told beside it. Of values that made letters, memos and fax
sheets had in zones with other labels only, 12 of 16 were right up to 2, 4 of 13 from 2 to 4, 4 of 24 from 4 to 8."""


ALWAYS = 1.0
"""Log odds of a page with a label against one without, from which on a page of the class has it somewhere."""


def evidence_of(is_read: bool) -> LabelEvidence:
    return READ if is_read else UNREAD


def label_confidences(conditional: NDArray[np.float64], labels: NDArray[np.intp]) -> NDArray[np.float64]:
    """Probability (N,) of each of `labels` among all labels, from `conditional_costs` (N, L)."""
    return np.asarray(softmax(-conditional, axis=1)[np.arange(len(labels)), labels])


def other_labels(
    conditional: NDArray[np.float64], labels: NDArray[np.intp], counts: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Probabilities (N, L) of the labels if `labels` (N,) are wrong, from `conditional_costs` (N, L).

    0 for `labels` themselves, and for those that are less probable by more than `MOST_AWAY`. A label that the samples'
    pages have, by its costs of 0, 1, ... zones a page (`counts`, (L, M)), is told however improbable: some zone has
    it.
    """
    rows = np.arange(len(labels))
    is_there = counts[:, 0] - counts.min(axis=1) > ALWAYS
    is_near = (conditional - conditional[rows, labels][:, None] <= MOST_AWAY) | is_there
    is_near[rows, labels] = False
    rest = conditional.copy()
    rest[rows, labels] = np.inf
    # A model of null alone has no other label.
    shares = softmax(-rest, axis=1) if conditional.shape[1] > 1 else np.zeros_like(rest)
    return np.where(is_near, shares, 0.0)


def zone_shares(tables: CostTables, labels: NDArray[np.intp]) -> NDArray[np.float64]:
    """Probabilities (N, L) that a zone has a label, if it is the only one with it.

    Costs of numbers of zones are left out: the label moves from one zone to another. 0 for null.

    Parameters
    ----------
    tables
        Costs of the page's zones by the model.
    labels
        (N,) of the match, which all other zones keep.
    """
    own = zone_costs(tables, labels)
    shares = np.zeros_like(own)
    for label in range(1, own.shape[1]):
        shares[:, label] = softmax(np.delete(own, label, axis=1).min(axis=1) - own[:, label], axis=0)
    return shares


def are_single(counts: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which labels (L,) the samples' pages have once rather than never or more often, by `counts` (L, M)."""
    if counts.shape[1] < 3:  # how often pages have several is not known
        return np.zeros(len(counts), np.bool_)
    return np.asarray(np.delete(counts, 1, axis=1).min(axis=1) - counts[:, 1] > ALWAYS)


def label_evidence(
    tables: CostTables,
    labels: NDArray[np.intp],
    conditional: NDArray[np.float64],
    samples: int,
    *,
    is_read: bool,
) -> NDArray[np.float64]:
    """Log odds (N,) that labels are right.

    Parameters
    ----------
    tables
        Costs of the page's zones by the model.
    labels
        (N,) of the match.
    conditional
        (N, L) `conditional_costs` of the labels.
    samples
        Number of those that the model is made of.
    is_read
        Whether the page's text was read (`LayoutGraph.is_read`).
    """
    kind = evidence_of(is_read)
    return label_features(tables, labels, conditional, samples, kind) @ kind.weights


def label_features(
    tables: CostTables,
    labels: NDArray[np.intp],
    conditional: NDArray[np.float64],
    samples: int,
    kind: LabelEvidence,
) -> NDArray[np.float64]:
    """`EVIDENCE_FEATURES` (N, 8) of labels within the bounds of `kind`; see `label_evidence`."""
    log_odds = _log_odds(label_confidences(conditional, labels), kind.most_log_odds)
    own, pairs = own_costs(tables, labels)
    own = np.clip(own, *kind.own_costs)
    every, of_samples = np.ones(len(labels)), np.log(max(1, samples))
    return np.column_stack(
        [
            every,
            log_odds,
            own,
            np.clip(pairs, *PAIR_COSTS),
            every * np.log(max(1, len(labels))),
            every * of_samples,
            log_odds * of_samples,
            log_odds * own,
        ]
    )


def _log_odds(confidence: NDArray[np.float64], most: float) -> NDArray[np.float64]:
    """Log odds of probabilities, at most `most` in size."""
    least = 1.0 / (1.0 + np.exp(most))
    bounded = np.clip(confidence, least, 1.0 - least)
    return np.asarray(np.log(bounded) - np.log1p(-bounded))
