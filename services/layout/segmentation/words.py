"""Assignment of OCR words to the lines of a page."""

import unicodedata
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from services.layout.segmentation.components import Boxes, Indices
from services.ocr.engine import Word

_SIGNS = frozenset("&+@/=:×*–—-")
"""What stands between words and is read as a word of its own; other marks alone are specks and rules more often."""


def is_word(word: Word) -> bool:
    """Whether it has a letter, a digit, or the sign of a currency."""
    return any(each.isalnum() or unicodedata.category(each) == "Sc" for each in word.text)


def is_sign(word: Word) -> bool:
    """Whether it is a sign alone, as "&" or "/"."""
    return len(word.text) == 1 and word.text in _SIGNS


def between_words(line_of_word: Indices, is_word: NDArray[np.bool_], boxes: Boxes) -> NDArray[np.bool_]:
    """Whether each word (N,) stands between two of its line that are words (`is_word`); `boxes` (N, 4)."""
    x0, x1 = boxes[:, 0], boxes[:, 2]
    within = np.zeros(len(line_of_word), dtype=np.bool_)
    for line in np.unique(line_of_word[~is_word & (line_of_word >= 0)]):
        own = line_of_word == line
        words = own & is_word
        within |= own & (x0 > x0[words].min(initial=np.inf)) & (x1 < x1[words].max(initial=-np.inf))
    return within


def assign_words(words: Sequence[Word], boxes: Boxes, lines: Boxes) -> Indices:
    """Line of every word (words,), -1 for none: the one that shares most of its box, the lower one before a higher.

    `boxes` (words, 4) and `lines` (lines, 4) in one frame. A word's centre must lie in the line's rows, give
    or take a quarter of its height, and half of the word in its columns.
    """
    if not words or len(lines) == 0:
        return np.full(len(words), -1, dtype=np.intp)
    centre = (boxes[:, 1] + boxes[:, 3])[:, None] / 2
    slack = 0.25 * (lines[:, 3] - lines[:, 1])[None, :]
    inside = (centre > lines[None, :, 1] - slack) & (centre < lines[None, :, 3] + slack)
    across = np.minimum(boxes[:, None, 2], lines[None, :, 2]) - np.maximum(
        boxes[:, None, 0], lines[None, :, 0]
    )
    down = np.minimum(boxes[:, None, 3], lines[None, :, 3]) - np.maximum(boxes[:, None, 1], lines[None, :, 1])
    inside &= across > 0.5 * (boxes[:, 2] - boxes[:, 0])[:, None]
    height = np.maximum((lines[:, 3] - lines[:, 1])[None], (boxes[:, 3] - boxes[:, 1])[:, None])
    shared = np.where(inside, across * np.maximum(down, 1e-3) / np.maximum(height, 1e-3), 0.0)
    best = np.argmax(shared, axis=1)
    return np.where(shared[np.arange(len(words)), best] > 0, best, -1)


def words_of_lines(
    words: Sequence[Word], boxes: Boxes, line_of_word: Indices, count: int
) -> list[list[Word]]:
    """Words of every line, from left to right."""
    found: list[list[Word]] = [[] for _ in range(count)]
    for index in np.argsort(boxes[:, 0], kind="stable") if len(words) else ():
        if line_of_word[index] >= 0:
            found[line_of_word[index]].append(words[index])
    return found


def line_confidences(words: Sequence[Word], line_of_word: Indices, count: int) -> NDArray[np.float64]:
    """Mean confidence of every line's words, weighted by their length; 0 without words."""
    length = np.array([len(word.text) for word in words], dtype=np.float64)
    confidence = np.array([word.confidence for word in words], dtype=np.float64)
    known = line_of_word >= 0
    total = np.bincount(line_of_word[known], weights=length[known], minlength=count)
    sure = np.bincount(line_of_word[known], weights=(length * confidence)[known], minlength=count)
    return np.asarray(sure / np.maximum(total, 1.0))
