"""How well a printed column fits a column of the samples: log likelihood ratios against any other column."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rapidfuzz.fuzz import ratio
from scipy.optimize import linear_sum_assignment

from services.layout.tables.cell_numbers import number_of, size_of
from services.layout.tables.print_rows import header_words
from services.layout.tables.table_model import ColumnModel, Sums, TableModel
from services.layout.values.kinds import KINDS, kind_of

_SAME_WORD = 75.0
"""Similarity, 0-100, from which on a header word is a known one: one wrong letter in four."""
_ANY_WORD = 0.01
"""Share of headers of any column that have one given word."""
_MOST_OF_WORD = 4.0
_MOST_OF_HEADER = 6.0
_LEAST_OF_HEADER = -2.5
_MOST_OF_EDGE = 2.5
_USUAL_SPREAD = 0.2
"""Standard deviation of an edge among firms, as a share of the page's width."""
_USUAL_EDGES = 0.5
"""As if so many edges had been seen with that spread."""
_PRIOR_CELLS = 2.0
"""As if so many cells had been seen, of every kind alike."""
_KINDS_COUNT = 3.0
"""Cells of one column say the same again and again: their mean counts as so many."""
_USUAL_SIZE, _SPREAD_OF_SIZES, _LEAST_SPREAD = 1.5, 1.2, 0.3
"""Mean and standard deviation of common logarithms of numbers in tables, and the least deviation within a column."""
_UNFILLED = 0.02
_NEVER = 1e3
_ALWAYS = 100.0
_SUREST = 6.0
"""Log odds that a column is that of its label; more is not believed."""


@dataclass(frozen=True, slots=True)
class PrintedColumn:
    """A column of a page: its edges in pixels, the text above it, and its cells' texts, "" in rows without one."""

    left: float
    right: float
    header: str = ""
    cells: tuple[str, ...] = ()

    @property
    def kinds(self) -> list[str]:
        """Those of its texts (`values.kinds.kind_of`)."""
        return [kind_of(text) for text in self.cells if text]


@dataclass(frozen=True, slots=True, eq=False)
class Assignment:
    """The printed column (its place) of each label, None where it has none; the score, and how sure each one is.

    `sure` has log odds of the choice for each label that has a column, against the next best one. `discount` is the
    place of a column of percents by which the products of each row are less; None where there is none.
    """

    places: Mapping[str, int | None]
    score: float
    sure: Mapping[str, float]
    discount: int | None = None


def kind_evidence(column: ColumnModel, kind: str) -> float:
    """Log likelihood ratio of one cell as one of this column, against one of any column.

    All cells of a page are of one firm, so that they count as one.
    """
    share = column.kinds.get(kind, 0.0) / max(1.0, sum(column.kinds.values()))
    seen = column.samples * share + _PRIOR_CELLS / len(KINDS)
    return math.log(seen / (column.samples + _PRIOR_CELLS) * len(KINDS) / 2.0)


def header_evidence(model: TableModel, text: str) -> dict[str, float]:
    """Log likelihood ratio of a header text for each label; 0 of a column of which no header was read."""
    words = list(dict.fromkeys(header_words(text)))
    found = {}
    shares = {column.label: [_share_of(column, word) for word in words] for column in model.columns}
    for column in model.columns:
        if not column.headers or not words:
            found[column.label] = 0.0
            continue
        total = 0.0
        for k in range(len(words)):
            others = [share[k] or 0.0 for label, share in shares.items() if label != column.label]
            anywhere = _ANY_WORD + 0.5 * sum(others) / max(1, len(others))
            share = shares[column.label][k]
            if share is None:  # a word that no sample has: how often samples have such words
                total += math.log(_new_word(column)) - (0.0 if max(others, default=0.0) == 0.0 else 1.0)
            else:
                total += min(_MOST_OF_WORD, math.log(share / anywhere))
        found[column.label] = float(np.clip(total, _LEAST_OF_HEADER, _MOST_OF_HEADER))
    return found


def _share_of(column: ColumnModel, word: str) -> float | None:
    """Share of the column's headers that have the word or one like it; None where none has."""
    count = column.headers.get(word, 0.0)
    if not count and len(word) > 3:
        count = max((n * _likeness(word, known) for known, n in column.headers.items()), default=0.0)
    return count / (column.samples + len(column.headers)) if count else None


def _likeness(word: str, known: str) -> float:
    """How surely two different words mean one: letters were misread, or one is a part of a compound of the other."""
    if ratio(word, known, score_cutoff=_SAME_WORD):
        return 0.7
    short, long = sorted((word, known), key=len)
    return 0.4 if len(short) > 3 and (long.startswith(short) or long.endswith(short)) else 0.0


def _new_word(column: ColumnModel) -> float:
    """Probability that the next header has a word that none had (Witten and Bell's estimate)."""
    return len(column.headers) / (column.samples + len(column.headers))


def edge_evidence(sums: Sums, share: float) -> float:
    """Log likelihood ratio of an edge, as a share of the page's width, against one anywhere on the page."""
    count, total, squares = sums
    if count < 0.5:
        return 0.0
    mean = total / count
    seen = max(0.0, squares - count * mean**2)
    variance = (seen + _USUAL_EDGES * _USUAL_SPREAD**2) / (count + _USUAL_EDGES) / max(1.0, count) ** 0.5
    variance = max(variance, 0.01**2)
    log = -0.5 * ((share - mean) ** 2 / variance + math.log(2 * math.pi * variance))
    return float(np.clip(log, -_MOST_OF_EDGE, _MOST_OF_EDGE))


def size_evidence(sums: Sums, sizes: Sequence[float]) -> float:
    """Log likelihood ratio of the sizes of numbers of a column against those of any: quantities are small, prices not.

    Numbers of one column are alike, so that their mean counts as a few.
    """
    count, total, squares = sums
    if count < 0.5 or not sizes:
        return 0.0
    weight = count + _USUAL_EDGES
    mean = (total + _USUAL_EDGES * _USUAL_SIZE) / weight
    variance = (
        max(0.0, squares - count * (total / count) ** 2) + _USUAL_EDGES * _SPREAD_OF_SIZES**2
    ) / weight + _LEAST_SPREAD**2
    own = sum((size - mean) ** 2 for size in sizes) / len(sizes) / variance + math.log(variance)
    usual = sum((size - _USUAL_SIZE) ** 2 for size in sizes) / len(
        sizes
    ) / _SPREAD_OF_SIZES**2 + 2 * math.log(_SPREAD_OF_SIZES)
    odds = min(_KINDS_COUNT, len(sizes)) * (usual - own) / 2
    return float(np.clip(odds, -_MOST_OF_EDGE, _MOST_OF_EDGE))


def column_scores(model: TableModel, columns: Sequence[PrintedColumn], width: float) -> NDArray[np.float64]:
    """Scores (L, C) of printed columns for the labels of `model`; `width` is that of the page."""
    scores = np.zeros((len(model.columns), len(columns)))
    for place, printed in enumerate(columns):
        headers, printed_kinds = header_evidence(model, printed.header), printed.kinds
        sizes = [size_of(number) for number in map(number_of, printed.cells) if number]
        for row, column in enumerate(model.columns):
            kinds = [kind_evidence(column, kind) for kind in printed_kinds]
            edges = max(
                edge_evidence(column.left, printed.left / width),
                edge_evidence(column.right, printed.right / width),
            )
            of_kinds = (
                size_evidence(column.sizes, sizes) + min(_KINDS_COUNT, len(kinds)) * sum(kinds) / len(kinds)
                if kinds
                else -1.0
            )
            scores[row, place] = headers[column.label] + edges + of_kinds
    return scores


def assign_columns(
    model: TableModel, scores: NDArray[np.float64], given: Mapping[str, int] | None = None
) -> Assignment:
    """The labels' columns with the largest sum of scores; a label may have none, at the cost of its usual presence.

    `given` are the places of labels that are known.
    """
    scores = scores.copy()
    for label, place in (given or {}).items():
        row = model.labels.index(label)
        scores[row] = np.where(np.arange(scores.shape[1]) == place, scores[row] + _ALWAYS, -_NEVER)
    best, total = _solve(model, scores)
    given_gain = _ALWAYS * len(given or {})
    sure = {}
    for row, label in enumerate(model.labels):
        own = best[row]
        if own is None:
            continue
        other = scores.copy()
        other[row, own] = -_NEVER
        sure[label] = min(_SUREST, total - _solve(model, other)[1])
    return Assignment(dict(zip(model.labels, best, strict=True)), total - given_gain, sure)


def _solve(model: TableModel, scores: NDArray[np.float64]) -> tuple[list[int | None], float]:
    labels, columns = scores.shape
    absent = np.full((labels, labels), -1e6)
    for row, column in enumerate(model.columns):
        share = (model.samples - column.samples + 0.5 * _UNFILLED) / (model.samples + _UNFILLED)
        absent[row, row] = math.log(max(_UNFILLED, share))
    wide = np.concatenate([scores, absent], axis=1)
    rows, places = linear_sum_assignment(wide, maximize=True)
    found = [int(place) if place < columns else None for place in places]
    return found, float(wide[rows, places].sum())
