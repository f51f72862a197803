"""Classes to split: models of two groups of samples fit held-out samples better than one model of all (5.7)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.discovery.class_samples import FEWEST_PAGES, ClassSamples, held_out_costs, match_sample
from services.layout.discovery.groups import find_medoid
from services.layout.discovery.page_distance import page_distances
from services.layout.model.statistics import total_statistics

_LEAST_SAMPLES = 8
"""Of the class: of fewer, models of parts have too few samples to win."""
LEAST_GAIN = 0.03
"""By how much of the joint model's costs the parts' models lower them. Homogeneous classes lose up to a tenth and
win 0.012 at most; unions of two publications win 0.05 and more."""
_LEAST_BETTER = 0.7
"""Share of the samples that cost less by the parts' models; of unions 0.8 and more."""


@dataclass(frozen=True, slots=True)
class SplitProposal:
    """A class whose samples are of two kinds.

    `parts` are indices of the samples, rising, and `typical` the sample in the middle of each part. `gain` is by how
    much of their cost held-out samples become cheaper, `better` the share of those that do.
    """

    name: str
    parts: tuple[tuple[int, ...], tuple[int, ...]]
    typical: tuple[int, int]
    gain: float
    better: float


def propose_split(samples: ClassSamples) -> SplitProposal | None:
    """The proposal to split a class; None if it is homogeneous or has too few samples."""
    proposal = compare_parts(samples)
    if proposal is None or proposal.gain < LEAST_GAIN or proposal.better < _LEAST_BETTER:
        return None
    return proposal


def compare_parts(samples: ClassSamples) -> SplitProposal | None:
    """The two groups of a class's samples and what their own models gain; None of too few samples."""
    if len(samples.samples) < _LEAST_SAMPLES:
        return None
    distances = page_distances(samples.verified())
    first = halve(distances)
    sizes = np.array([first.sum(), (~first).sum()])
    if sizes.min() < FEWEST_PAGES:
        return None
    joint, parted = held_out_costs(samples), _costs_by_parts(samples, first)
    gain = float((joint.mean() - parted.mean()) / max(abs(joint.mean()), 1.0))
    better = float(np.mean(parted < joint))
    parts = [np.flatnonzero(first), np.flatnonzero(~first)]
    parts.sort(key=lambda part: (-len(part), int(part[0])))
    typical = [int(part[find_medoid(distances[np.ix_(part, part)])]) for part in parts]
    return SplitProposal(
        samples.name,
        (tuple(map(int, parts[0])), tuple(map(int, parts[1]))),
        (typical[0], typical[1]),
        gain,
        better,
    )


def halve(distances: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each of P >= 2 items belongs to the first of two groups (P,), by 2-medoids clustering.

    All pairs of medoids are tried. The least sum of distances wins, so that a single outlier does not form a group when
    there are two groups.
    """
    one, other = np.triu_indices(len(distances), 1)
    best = np.argmin(np.minimum(distances[one], distances[other]).sum(axis=1))
    return np.asarray(distances[one[best]] <= distances[other[best]])


def _costs_by_parts(samples: ClassSamples, first: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Cost a zone (S,) of every sample by the better of both parts' models, made without that sample."""
    totals = [
        total_statistics(
            own for own, is_first in zip(samples.statistics, first, strict=True) if is_first == part
        )
        for part in (True, False)
    ]
    whole = [samples.model(total) for total in totals]
    costs = np.empty(len(samples.samples))
    for index, (views, own) in enumerate(zip(samples.samples, samples.statistics, strict=True)):
        mine = 0 if first[index] else 1
        without = samples.model(totals[mine] - own)
        costs[index] = min(match_sample(views, model).cost for model in (without, whole[1 - mine]))
    return costs
