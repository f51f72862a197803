"""Simulated cost tables with a hidden truth, as layout graphs of pages give them, from easy to hopeless."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.cost_tables import CostTables


@dataclass(frozen=True, slots=True)
class Hardness:
    """`clear`: share of zones whose own cost tells the label; `signal` and `noise` of pairs, nats."""

    clear: float
    signal: float
    noise: float


EASY = Hardness(0.9, 0.5, 0.2)
TYPICAL = Hardness(0.8, 0.4, 0.4)
HARD = Hardness(0.6, 0.2, 0.5)
HOPELESS = Hardness(0.0, 0.0, 1.0)


def simulated_tables(
    zones: int,
    labels: int,
    hardness: Hardness,
    rng: np.random.Generator,
    density: float = 1.0,
) -> tuple[CostTables, NDArray[np.intp]]:
    """Tables of a page of `zones` zones with `labels` labels besides null, and its true labels.

    Pairs see a relation (above, beside, ...) which each pair of labels has its own odds for, so that their costs
    are shared by many pairs of labels, as those of real pages are.
    """
    width = labels + 1
    body = labels
    truth = rng.choice(width, zones, p=_frequencies(labels))
    node = rng.uniform(3.0, 9.0, (zones, width))
    unclear = rng.random(zones) >= hardness.clear
    node[np.arange(zones), truth] = rng.uniform(0.0, 2.0, zones)
    node[unclear] = rng.uniform(0.0, 3.0, (int(unclear.sum()), width))
    low, high = np.triu_indices(zones, 1)
    kept = rng.random(len(low)) < density
    pairs = np.stack([low[kept], high[kept]], 1).astype(np.intp)
    relations = 9
    odds = rng.normal(0.0, 1.0, (relations, width, width))
    expected = odds.argmin(0)
    seen = expected[truth[pairs[:, 0]], truth[pairs[:, 1]]]
    wrong = rng.random(len(pairs)) < hardness.noise / 2
    seen = np.where(wrong, rng.integers(0, relations, len(pairs)), seen)
    edge = hardness.signal * odds[seen] + hardness.noise * rng.normal(0.0, 0.3, (len(pairs), width, width))
    return CostTables(node, pairs, edge, _counts(zones, labels, body)), truth


def _frequencies(labels: int) -> NDArray[np.float64]:
    frequency = np.ones(labels + 1)
    frequency[0], frequency[labels] = 1.5, 0.4 * (labels + 1)
    return frequency / frequency.sum()


def _counts(zones: int, labels: int, body: int) -> NDArray[np.float64]:
    """Null and body are free; every other label is missed when absent, a third of them may be there but once."""
    count = np.zeros((labels + 1, zones + 1))
    for label in range(1, labels + 1):
        if label != body:
            count[label, 0] = 2.0 + label % 3
            if label % 3 == 0:
                count[label, 2:] = 3.0 * np.arange(1, zones)
    return count


def strong_tables(zones: int, labels: int, scale: float, rng: np.random.Generator) -> CostTables:
    """Random tables whose pairs and counts outweigh the zones' own costs; about a third of the pairs is missing."""
    low, high = np.triu_indices(zones, 1)
    kept = rng.random(len(low)) < 0.7
    pairs = np.stack([low[kept], high[kept]], 1).astype(np.intp)
    return CostTables(
        rng.normal(0.0, 1.0, (zones, labels)),
        pairs,
        rng.normal(0.0, scale, (len(pairs), labels, labels)),
        rng.normal(0.0, scale, (labels, zones + 1)),
    )
