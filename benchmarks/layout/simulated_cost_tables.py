"""Simulated cost tables with a hidden truth, as layout graphs of pages give them, from easy to hopeless.

A class has a typical place for each label; a page jitters them. Pairs are seen by qualitative relations (left of,
aligned, right of; above, level, below), whose costs are the negative logarithms of their frequencies in sample pages.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.matching.cost_tables import CostTables

_SAMPLES = 10
"""Pages from which the frequencies of relations are taken."""
_ALIGNED = 0.03
"""Places nearer than this, in page widths, are aligned."""
_PAIRS_A_ZONE = 15.0
"""With more pairs than these each weighs less: places say something of every zone, not of every pair anew."""


@dataclass(frozen=True, slots=True)
class Hardness:
    """`clear`: share of zones whose own cost tells the label; `jitter` of places on the page, in page widths;
    `weight` of a pair's relations; `noise` of its costs, nats."""

    clear: float
    jitter: float
    weight: float
    noise: float


EASY = Hardness(0.9, 0.01, 0.1, 0.05)
TYPICAL = Hardness(0.8, 0.03, 0.2, 0.1)
HARD = Hardness(0.6, 0.08, 0.3, 0.3)
HOPELESS = Hardness(0.0, 0.5, 0.1, 1.0)


def simulated_tables(
    zones: int, labels: int, hardness: Hardness, rng: np.random.Generator, density: float = 1.0
) -> tuple[CostTables, NDArray[np.intp]]:
    """Tables of a page of `zones` zones with `labels` labels besides null, and its true labels (N,).

    The last label is the body, which takes what the others leave; `density` is the share of pairs that have costs.
    """
    width = labels + 1
    places = rng.uniform(0.0, 1.0, (width, 2))
    places[:, 0] = np.round(3 * places[:, 0]) / 3  # columns
    truth = _labels(zones, labels, rng)
    low, high = np.triu_indices(zones, 1)
    kept = rng.random(len(low)) < density
    pairs = np.stack([low[kept], high[kept]], 1).astype(np.intp)
    frequency = np.full((2, 3, width, width), 0.5)
    for _ in range(_SAMPLES):
        sample = _labels(max(zones, 12), labels, rng)
        i, j = np.nonzero(~np.eye(len(sample), dtype=bool))
        seen = _relations(_page(sample, places, hardness, rng), i, j)
        for axis in range(2):
            np.add.at(frequency[axis], (seen[axis], sample[i], sample[j]), 1.0)
    costs = -np.log(frequency / frequency.sum(1, keepdims=True))
    seen = _relations(_page(truth, places, hardness, rng), *pairs.T)
    # three boundaries of a kind (one side, the other, the centre) mostly agree
    scale = min(1.0, _PAIRS_A_ZONE / (density * max(zones, 1)))
    edge = 3 * hardness.weight * (costs[0, seen[0]] + costs[1, seen[1]])
    edge = scale * edge + scale * hardness.noise * rng.normal(0.0, 1.0, edge.shape)
    node = rng.uniform(3.0, 9.0, (zones, width))
    node[np.arange(zones), truth] = rng.uniform(0.0, 2.0, zones)
    unclear = rng.random(zones) >= hardness.clear
    node[unclear] = rng.uniform(0.0, 3.0, (int(unclear.sum()), width))
    return CostTables(node, pairs, edge - edge.mean((1, 2), keepdims=True), _counts(zones, labels)), truth


def _labels(zones: int, labels: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Labels of a page: most are there once, a third of them up to three times, some zones are of none."""
    many = rng.integers(1, 4, labels)
    some = np.where(np.arange(labels) % 3 == 2, many, 1) * (rng.random(labels) < 0.85)
    names = rng.permutation(np.repeat(np.arange(1, labels + 1), some))[: max(1, 2 * zones // 3)]
    rest = np.where(rng.random(zones) < 0.2, 0, labels)
    rest[: min(len(names), zones)] = names[:zones]
    return rng.permutation(rest).astype(np.intp)


def _page(
    labels: NDArray[np.intp], places: NDArray[np.float64], hardness: Hardness, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Places (N, 2) of zones; those of null and of the body are spread over the page."""
    page = places[labels] + hardness.jitter * rng.normal(0.0, 1.0, (len(labels), 2))
    page[labels == 0] = rng.uniform(0.0, 1.0, (int((labels == 0).sum()), 2))
    body = labels == len(places) - 1
    page[body, 0] = rng.integers(0, 2, int(body.sum())) / 2
    page[body, 1] = rng.uniform(0.3, 1.0, int(body.sum()))
    return page


def _relations(page: NDArray[np.float64], i: NDArray[np.intp], j: NDArray[np.intp]) -> NDArray[np.intp]:
    """(2, E): 0, 1, 2 for left of, aligned, right of; above, level, below."""
    apart = (page[j] - page[i]).T
    return (np.sign(apart) * (np.abs(apart) > _ALIGNED)).astype(np.intp) + 1


def _counts(zones: int, labels: int) -> NDArray[np.float64]:
    """Null and body are free; every other label is missed when absent, two thirds of them may be there but once."""
    count = np.zeros((labels + 1, zones + 1))
    for label in range(1, labels):
        count[label, 0] = 2.0 + label % 3
        if label % 3 != 0:
            count[label, 2:] = 3.0 * np.arange(1, zones)
    return count


def strong_tables(
    zones: int, labels: int, scale: float, rng: np.random.Generator, counts: float | None = None
) -> CostTables:
    """Random tables, costs of pairs `scale` and of counts `counts` (as pairs) times those of zones; about a third of
    the pairs is missing."""
    counts = scale if counts is None else counts
    low, high = np.triu_indices(zones, 1)
    kept = rng.random(len(low)) < 0.7
    pairs = np.stack([low[kept], high[kept]], 1).astype(np.intp)
    return CostTables(
        rng.normal(0.0, 1.0, (zones, labels)),
        pairs,
        rng.normal(0.0, scale, (len(pairs), labels, labels)),
        rng.normal(0.0, counts, (labels, zones + 1)),
    )
