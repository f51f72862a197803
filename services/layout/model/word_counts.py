"""How many zones of each label have a token (`graph.zone_words`), and what tokens say for a label.

The evidence of a token for a label compares how many zones of the label have it with how many would if labels did not
matter: log (O + a) / (E + a). With `a` a rare token says little, for a label as against it, so that one sample helps
and does not blind (Norén, Hopstadius, Bate: Shrinkage observed-to-expected ratios, 2013). A token that no sample has
says nothing.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.zone_words import WORD_ASPECTS, Tokens

Sums = NDArray[np.float64]
Token = tuple[int, str]
"""Its aspect, as an index of `WORD_ASPECTS`, and itself."""

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


def count_words(tokens: Sequence[Tokens], labels: NDArray[np.intp], count: int) -> WordCounts:
    """Counts of the zones of a page, whose `labels` (N,) are indices of `count` ones."""
    counts: dict[Token, Sums] = {}
    zones = np.zeros((count, len(WORD_ASPECTS)))
    for own, label in zip(tokens, labels.tolist(), strict=True):
        for aspect, texts in enumerate(own):
            zones[label, aspect] += bool(texts)
            for text in texts:
                token = (aspect, text)
                if token not in counts:
                    counts[token] = np.zeros(count)
                counts[token][label] += 1.0
    return WordCounts(zones, counts)


def word_costs(tokens: Sequence[Tokens], words: WordCounts) -> NDArray[np.float64]:
    """Costs (N, L, W) of giving zones the labels, by aspect: 0 where no sample has a zone's tokens.

    Tokens of a zone say much the same, so that their sum counts as that of a root of their number.
    """
    labels, aspects = words.zones.shape
    costs = np.zeros((len(tokens), labels, aspects))
    known = [
        [[(aspect, text) for text in texts if (aspect, text) in words.counts] for aspect, texts in enumerate(own)]
        for own in tokens
    ]
    different = list(dict.fromkeys(token for own in known for each in own for token in each))
    if not different:
        return costs
    seen = np.stack([words.counts[token] for token in different])
    aspect_of = np.array([aspect for aspect, _ in different])
    zones = words.zones.T[aspect_of]
    expected = seen.sum(axis=1, keepdims=True) * zones / zones.sum(axis=1, keepdims=True)
    evidence = np.log((seen + _SHRINKAGE) / (expected + _SHRINKAGE))
    place = {token: row for row, token in enumerate(different)}
    for zone, own in enumerate(known):
        for aspect, each in enumerate(own):
            if each:
                rows = [place[token] for token in each]
                costs[zone, :, aspect] = -evidence[rows].sum(axis=0) / np.sqrt(len(rows))
    return costs


def dearest_tokens(words: WordCounts, most: int) -> Iterable[Token]:
    """At most `most` tokens that are worth keeping: of labels before those of null alone, the frequent ones first."""
    labelled = {token: float(own[1:].sum()) for token, own in words.counts.items()}
    order = sorted(words.counts, key=lambda token: (-labelled[token], -float(words.counts[token].sum()), token))
    return order[:most]
