"""Classes that recognition cannot distinguish: each model fits the other class's samples as well as its own (5.7)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from services.layout.discovery.class_samples import FEWEST_PAGES, ClassSamples, held_out_costs, match_sample
from services.layout.discovery.groups import find_medoid
from services.layout.discovery.page_distance import page_distances
from services.layout.recognition.classification import SHARE_OF_MEAN, SHARPNESS

LEAST_FIT = 0.7
"""Costs of a class's samples by the other's model, as a share of those by its own: of halves 0.75 to 1, of
different classes 0.6 at most."""
_CLEAR_ODDS = 3.0
"""Log odds from which a decision between the two classes is clear: the other one has a twentieth."""
_LEAST_UNSURE = 0.15
"""Share of the samples whose class is decided wrongly or not clearly: of halves 0.17 to 1, of different classes
none as a rule."""
_LEAST_AGREEMENT = 0.7
"""Share of zones whose labels by the two models correspond."""
_MOST_PAIRS = 100
"""Pairs of classes that are compared, those with the nearest typical pages; 0.1 s each."""


@dataclass(frozen=True, slots=True)
class MergeProposal:
    """Two classes that may be one, in the order of their names.

    `fit` is how well each one's model explains the other's samples compared with their own model, the smaller of both;
    1: as well. `unsure` is the share of samples whose class is decided wrongly or not clearly. `labels` leads from
    the second one's labels to the first one's where the names differ, None being no label; `agreement` is the share of
    zones to which it applies.
    """

    first: str
    second: str
    fit: float
    unsure: float
    agreement: float
    labels: dict[str, str | None]


def propose_merges(classes: Sequence[ClassSamples]) -> tuple[MergeProposal, ...]:
    """Pairs of classes that recognition cannot distinguish, the most similar first."""
    able = sorted(
        (each for each in classes if len(each.samples) >= FEWEST_PAGES),
        key=lambda each: each.name,
    )
    if len(able) < 2:
        return ()
    typical = []
    for each in able:
        graphs = each.verified()
        typical.append(graphs[find_medoid(page_distances(graphs))])
    distances = page_distances(typical)
    first, second = np.triu_indices(len(able), 1)
    nearest = np.argsort(distances[first, second], kind="stable")[:_MOST_PAIRS]
    costs: dict[str, NDArray[np.float64]] = {}
    found = []
    for pair in nearest:
        one, other = able[first[pair]], able[second[pair]]
        for each in (one, other):
            if each.name not in costs:
                costs[each.name] = held_out_costs(each)
        proposal = compare_classes(one, other, costs[one.name], costs[other.name])
        if are_indistinguishable(proposal):
            found.append(proposal)
    return tuple(sorted(found, key=lambda each: (-each.fit, each.first, each.second)))


def are_indistinguishable(proposal: MergeProposal) -> bool:
    """Whether a comparison of two classes is a reason to merge them."""
    return (
        proposal.fit >= LEAST_FIT
        and proposal.unsure >= _LEAST_UNSURE
        and proposal.agreement >= _LEAST_AGREEMENT
    )


def compare_classes(
    one: ClassSamples,
    other: ClassSamples,
    own_costs: NDArray[np.float64],
    other_costs: NDArray[np.float64],
) -> MergeProposal:
    """The similarity of two classes, given their costs from `held_out_costs`."""
    forth, forth_labels = _match_all(one, other)
    back, back_labels = _match_all(other, one)
    fit = min(
        forth.mean() / min(own_costs.mean(), -1.0),
        back.mean() / min(other_costs.mean(), -1.0),
    )

    offset = SHARE_OF_MEAN * (own_costs.mean() - other_costs.mean())
    odds = SHARPNESS * np.concatenate([forth - own_costs + offset, back - other_costs - offset])
    unsure = float(np.mean(odds < _CLEAR_ODDS))
    agreement, labels = _map_labels(one, other, forth_labels, back_labels)
    return MergeProposal(one.name, other.name, float(fit), unsure, agreement, labels)


def _match_all(samples: ClassSamples, by: ClassSamples) -> tuple[NDArray[np.float64], list[NDArray[np.intp]]]:
    model = by.model()
    matched = [match_sample(views, model) for views in samples.samples]
    return np.array([each.cost for each in matched]), [each.labels for each in matched]


def _map_labels(
    one: ClassSamples,
    other: ClassSamples,
    forth: Sequence[NDArray[np.intp]],
    back: Sequence[NDArray[np.intp]],
) -> tuple[float, dict[str, str | None]]:
    """Share of zones with agreeing labels, and the second class's labels by the first one's where they differ.

    Each zone of both classes' samples has a label of its own class, given by a person, and one of the other's, found;
    labels that occur together most often correspond.
    """
    met = np.zeros((len(one.labels), len(other.labels)))
    for samples, found, turned in ((one, forth, False), (other, back, True)):
        index = {label: position for position, label in enumerate(samples.labels)}
        for views, labels in zip(samples.samples, found, strict=True):
            given = np.array([index[label] for label in views[0].labels], dtype=np.intp)
            np.add.at(met, (labels, given) if turned else (given, labels), 1.0)
    rows, columns = linear_sum_assignment(met, maximize=True)
    of_other = {int(column): int(row) for row, column in zip(rows, columns, strict=True) if met[row, column]}
    agreement = float(sum(met[row, column] for column, row in of_other.items()) / met.sum())
    renamed = {
        label: one.labels[of_other[column]]
        for column, label in enumerate(other.labels)
        if label is not None and column in of_other and one.labels[of_other[column]] != label
    }
    return agreement, renamed
