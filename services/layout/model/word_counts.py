"""How many zones of each label have a token (`graph.zone_words`), and what tokens say for a label.

The evidence of a token for a label compares how many zones of the label have it with how many would if labels did not
matter: log (O + a) / (E + a). With `a` a rare token says little, for a label as against it, so that one sample helps
and does not blind (Norén, Hopstadius, Bate: Shrinkage observed-to-expected ratios, 2013). A token that no sample has
says nothing.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from services.layout.graph.zone_words import WORD_ASPECTS, PageTokens, Token

Sums = NDArray[np.float64]

_SHRINKAGE = 0.25
"""Zones that are added to what is seen and to what is expected. Half a zone finds as much, a whole one less."""
_ROUNDING = 1e-6
MOST_KEPT = 4000
"""Tokens of a stored model: twenty samples of sixty lines have about as many that occur twice."""
LEAST_ZONES = 1e-3
"""Fewer zones, which fading leaves, are none."""


@dataclass(frozen=True, slots=True, eq=False)
class WordCounts:
    """Of L labels and W aspects: `zones` (L, W) with any token of an aspect, and those with each token (L,)."""

    zones: Sums
    counts: Mapping[Token, Sums] = field(default_factory=dict)

    def __add__(self, other: "WordCounts") -> "WordCounts":
        counts = dict(self.counts)
        for token, more in other.counts.items():
            own = counts.get(token)
            counts[token] = more if own is None else own + more
        return WordCounts(self.zones + other.zones, counts)

    def __sub__(self, other: "WordCounts") -> "WordCounts":
        """The counts without those of `other`, which must be part of these."""
        counts = dict(self.counts)
        for token, less in other.counts.items():
            left = counts[token] - less
            if left.max(initial=0.0) > _ROUNDING:
                counts[token] = np.maximum(left, 0.0)
            else:
                del counts[token]
        return WordCounts(np.maximum(self.zones - other.zones, 0.0), counts)

    def __mul__(self, factor: float) -> "WordCounts":
        return WordCounts(self.zones * factor, {token: own * factor for token, own in self.counts.items()})

    __rmul__ = __mul__

    def __truediv__(self, divisor: float) -> "WordCounts":
        return self * (1.0 / divisor)

    def with_labels(self, count: int) -> "WordCounts":
        """The counts of `count` labels, of which the last ones have no zones."""
        more = (0, count - len(self.zones))
        return WordCounts(
            np.pad(self.zones, (more, (0, 0))),
            {token: np.pad(own, (more,)) for token, own in self.counts.items()},
        )


def no_words(labels: int) -> WordCounts:
    """The counts of labels without zones."""
    return WordCounts(np.zeros((labels, len(WORD_ASPECTS))))


def count_words(page: PageTokens, labels: NDArray[np.intp], count: int) -> WordCounts:
    """Counts of the zones of a page, whose `labels` (N,) are indices of `count` ones."""
    aspects = len(WORD_ASPECTS)
    zone, aspect = np.divmod(np.unique(page.rows), aspects)
    zones = np.zeros((count, aspects))
    np.add.at(zones, (labels[zone], aspect), 1.0)
    seen = np.zeros((len(page.tokens), count))
    np.add.at(seen, (page.columns, labels[page.rows // aspects]), 1.0)
    return WordCounts(zones, dict(zip(page.tokens, seen, strict=True)))


def word_costs(page: PageTokens, zones: int, words: WordCounts) -> NDArray[np.float64]:
    """Costs (N, L, W) of giving `zones` zones the labels, by aspect: 0 where no sample has a zone's tokens.

    Tokens of a zone say much the same, so that their sum counts as that of a root of their number.
    """
    labels, aspects = words.zones.shape
    known = [place for place, token in enumerate(page.tokens) if token in words.counts]
    if not known:
        return np.zeros((zones, labels, aspects))
    seen = np.concatenate([words.counts[page.tokens[place]] for place in known]).reshape(-1, labels)
    having = words.zones.T[[page.tokens[place][0] for place in known]]
    expected = seen.sum(axis=1, keepdims=True) * having / having.sum(axis=1, keepdims=True)
    evidence = np.log((seen + _SHRINKAGE) / (expected + _SHRINKAGE))
    column = np.full(len(page.tokens), -1)
    column[known] = np.arange(len(known))
    kept = column[page.columns] >= 0
    rows, columns = page.rows[kept], column[page.columns[kept]]
    has = csr_array((np.ones(len(rows)), (rows, columns)), shape=(zones * aspects, len(known)))
    number = np.bincount(rows, minlength=zones * aspects)
    costs = -(has @ evidence) / np.sqrt(np.maximum(number, 1))[:, None]
    return np.asarray(costs.reshape(zones, aspects, labels).transpose(0, 2, 1))


def dearest_tokens(words: WordCounts, most: int) -> Iterable[Token]:
    """At most `most` tokens that are worth keeping: of labels before those of null alone, the frequent ones first."""
    labelled = {token: float(own[1:].sum()) for token, own in words.counts.items()}
    order = sorted(
        words.counts, key=lambda token: (-labelled[token], -float(words.counts[token].sum()), token)
    )
    return order[:most]
