"""Sufficient statistics of a class: sums over labelled pages, from which single pages can be subtracted."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from functools import reduce
from operator import add

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.layout_graph import RELATION_OFFSETS, LayoutGraph
from services.layout.model.word_counts import WordCounts, count_words

MOST_COUNTED = 13
"""Zones of one label on a page are counted up to this number; more count as many."""

ROUNDING = 1e-9

Sums = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LabelledGraph:
    """A graph and the labels of its zones, None for null."""

    graph: LayoutGraph
    labels: tuple[str | None, ...]


@dataclass(frozen=True, slots=True, eq=False)
class LabelStatistics:
    """Sums over pages for L labels, A numeric attributes, C content features and D descriptors.

    `zones` (L,); `known`, `totals`, `squares` (L, A) of numeric values that are known; `read` (L, C) zones whose
    content feature is known and `content` the sums of their confidences; `descriptors` (L, L, D) by label of the upper
    and of the lower zone; `counts` (L, MOST_COUNTED + 1) pages by the number of their zones with the label;
    `pages` (1,); `words` the zones of each label by their tokens.
    """

    zones: Sums
    known: Sums
    totals: Sums
    squares: Sums
    read: Sums
    content: Sums
    descriptors: Sums
    counts: Sums
    pages: Sums
    words: WordCounts

    def __add__(self, other: "LabelStatistics") -> "LabelStatistics":
        return LabelStatistics(
            *(getattr(self, each.name) + getattr(other, each.name) for each in fields(self))
        )

    def __sub__(self, other: "LabelStatistics") -> "LabelStatistics":
        """The sums without the pages of `other`, which must be part of these sums."""
        left = [getattr(self, each.name) - getattr(other, each.name) for each in fields(self)[:-1]]
        # Sums of confidences and squares may miss zero by a rounding error.
        sums = (np.where(np.abs(values) < ROUNDING, 0.0, values) for values in left)
        return LabelStatistics(*sums, self.words - other.words)  # type: ignore[arg-type, call-arg]


def label_indices(labels: Sequence[str | None], known: Sequence[str | None]) -> NDArray[np.intp]:
    """Index of every label among the `known` ones."""
    index = {label: position for position, label in enumerate(known)}
    return np.array([index[label] for label in labels], dtype=np.intp)


def gather_statistics(page: LabelledGraph, labels: Sequence[str | None]) -> LabelStatistics:
    """Sums over the zones of one page; every label of its zones is one of `labels`."""
    graph, count = page.graph, len(labels)
    given = label_indices(page.labels, labels)
    member = np.zeros((count, graph.zones))
    member[given, np.arange(graph.zones)] = 1.0
    known = np.isfinite(graph.numeric)
    values = np.where(known, graph.numeric, 0.0)
    read = np.isfinite(graph.content)
    upper, lower = given[graph.pairs.T]
    every = RELATION_OFFSETS[-1]
    seen = (upper * count + lower)[:, None] * every + graph.relations + RELATION_OFFSETS[:-1]
    descriptors = np.bincount(seen.ravel(), minlength=count * count * every).astype(np.float64)
    zones = member.sum(axis=1)
    counts = np.zeros((count, MOST_COUNTED + 1))
    counts[np.arange(count), np.minimum(zones, MOST_COUNTED).astype(np.intp)] = 1.0
    return LabelStatistics(
        zones=zones,
        known=member @ known,
        totals=member @ values,
        squares=member @ values**2,
        read=member @ read,
        content=member @ np.where(read, graph.content, 0.0),
        descriptors=descriptors.reshape(count, count, -1),
        counts=counts,
        pages=np.ones(1),
        words=count_words(graph.tokens, given, count),
    )


def sample_statistics(views: Sequence[LabelledGraph], labels: Sequence[str | None]) -> LabelStatistics:
    """Sums of one sample that was seen in several ways, which count as one page together."""
    total = total_statistics([gather_statistics(view, labels) for view in views])
    return LabelStatistics(*(getattr(total, each.name) / len(views) for each in fields(total)))


def total_statistics(pages: Iterable[LabelStatistics]) -> LabelStatistics:
    """Sum over pages, at least one; those of an iterator need not be in memory together (1.6 MB for 60 labels)."""
    return reduce(add, pages)
