"""Boxes of the words of one line, put right where they overlap.

Tesseract's boxes come from the letters' places in time, as its network saw them. In joined scripts a word's box often
reaches over a neighbour, or over several. Such a box has the wrong place in the line, and marks the wrong words.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from services.ocr.engine import UNSURE, Word

_WITHIN = 0.7
"""A word of which so much lies within a wider one is spanned by it."""
_LEAST_PART = 0.12
"""Least part of a box that may stay, over its height, for each of its characters: thin letters are as narrow."""
_GAP = 0.12
"""Left free beside a spanned word, over the height: readers of PDFs find the spaces of words by such gaps."""
_COVERED = 0.5
"""Share of an unsure word that the sure one covers."""
_TOO_HIGH = 1.3
"""A box that is higher than usual in its line by this factor reaches into another line."""


Span = tuple[float, float]
"""(x0, x1) in pixels."""


def settle_boxes(words: Sequence[Word]) -> list[Word]:
    """The words of one line, in any order; none of their boxes spans another one, and none is there twice."""

    apart = [_without_spanned(word, words) for word in words]
    return [word for word in apart if not _read_twice(word, apart)]


def with_common_rows(words: Sequence[Word]) -> list[Word]:
    """The words of one line with boxes of one height, along a straight line through their middles.

    For scripts whose letters have tails and dots of any length: the engine's boxes are by chance as high as a letter,
    the row, or two rows. Readers of PDFs find no lines in such words.
    """

    heights = np.array([word.box[3] - word.box[1] for word in words])
    height = float(np.quantile(heights, 0.5, method="lower"))
    own = heights <= _TOO_HIGH * height
    across = np.array([(word.box[0] + word.box[2]) / 2 for word in words])
    middles = np.array([(word.box[1] + word.box[3]) / 2 for word in words])
    slope, level = np.polyfit(across[own], middles[own], 1) if own.sum() > 3 else (0.0, middles[own].mean())
    tops = slope * across + level - height / 2
    return [
        replace(word, box=(word.box[0], float(top), word.box[2], float(top) + height))
        for word, top in zip(words, tops, strict=True)
    ]


def _without_spanned(word: Word, words: Sequence[Word]) -> Word:
    """The word with the widest part of its box that no spanned neighbour has."""
    x0, y0, x1, y1 = word.box
    gap = _GAP * (y1 - y0)
    spanned = [
        (other.box[0] - gap, other.box[2] + gap)
        for other in words
        if other.box[2] - other.box[0] < x1 - x0
        and _common(word, other) >= _WITHIN * (other.box[2] - other.box[0])
    ]
    if not spanned:
        return word
    left, right = max(_parts_between((x0, x1), spanned), key=lambda part: part[1] - part[0])
    if right - left < _LEAST_PART * (y1 - y0) * len(word.text):
        return word
    return replace(word, box=(left, y0, right, y1))


def _parts_between(span: Span, taken: Sequence[Span]) -> list[Span]:
    """Parts of `span` that are free of `taken`; an empty one at its end at least."""
    parts, start = [], span[0]
    for x0, x1 in sorted(taken):
        parts.append((start, max(start, x0)))
        start = max(start, x1)
    return [*parts, (min(start, span[1]), span[1])]


def _read_twice(word: Word, words: Sequence[Word]) -> bool:
    if word.confidence >= UNSURE:
        return False
    width = word.box[2] - word.box[0]
    return any(
        other.confidence > UNSURE and _common(word, other) >= _COVERED * width
        for other in words
        if other is not word
    )


def _common(one: Word, other: Word) -> float:
    """Common extent of two boxes along the line."""
    return min(one.box[2], other.box[2]) - max(one.box[0], other.box[0])
