"""Words that were read where the ink showed no line: they become lines of their own.

Segmentation finds lines in connected components. Print of dots, or print that runs into a dark border, falls apart or
together, and a reader that looks at the picture reads it all the same. Where much of what was read has no line, the
words are believed, and not the components.
"""

import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from services.layout.read_words import is_value
from services.layout.segmentation.fine_page import FinePage
from services.layout.segmentation.frame import LevelledFrame
from services.layout.segmentation.text_lines import CAPITAL_HEIGHT, Line
from services.layout.word_rows import rows_of_words
from services.ocr.engine import MADE_UP, Word

_SURE = 0.6
"""Least confidence of a word that is believed without a line."""
_MANY = 0.25
"""Share of the sure words that have no line, from which on the components are not believed. On letters in which a
signature or a stamp covers print it is up to 15 %."""
_FEW = 5
_SURE_VALUE = 0.9
"""Least confidence of a date, time or amount that is believed though few words have no line: they are what forms are
read for, and print that only looks like a letter is never one."""
_COLUMN_GAP = 2.0
"""Space between two words that parts lines, in heights of the words."""
_COVERED = 0.5
"""Share of a line without words from which on it is a scrap of the lines that were read."""


def with_lost_words(fine: FinePage, words: Sequence[Word] | None, frame: LevelledFrame) -> FinePage:
    """The page with lines of the `words` that no line and no figure has, each a block.

    Where these are few, only sure values are taken; where there are none, it is the same page.
    """
    sure = [word for word in words or () if word.confidence >= _SURE and any(map(str.isalnum, word.text))]
    held = _held(fine)
    lost = [word for word in sure if (word.text, word.box) not in held]
    if len(lost) < max(_FEW, _MANY * len(sure)):
        lost = [word for word in lost if word.confidence >= _SURE_VALUE and is_value(word.text)]
    if not lost:
        return fine
    rows = list(_rows(lost))
    boxes = np.array([_hull(row) for row in rows])
    levelled = frame.level(boxes / np.array([*frame.scale, *frame.scale]))
    lines = [_line(box) for box in levelled]
    scraps = _scraps(fine, boxes)
    blocks = [tuple(line for line in block if line not in scraps) for block in fine.blocks]
    count = len(fine.lines)
    return replace(
        fine,
        lines=(*fine.lines, *lines),
        boxes=np.concatenate([fine.boxes, boxes]),
        texts=(*fine.texts, *(" ".join(word.text for word in row) for row in rows)),
        words=(*fine.words, *map(tuple, rows)),
        blocks=(*(block for block in blocks if block), *((count + row,) for row in range(len(rows)))),
    )


def with_loose_words(fine: FinePage, words: Sequence[Word] | None) -> FinePage:
    """The page with those of the `words` that no line and no figure has: signs alone, and a few that were lost."""
    held = _held(fine)
    loose = (
        word
        for word in words or ()
        if word.confidence >= MADE_UP
        and any(map(_says_something, word.text))
        and (word.text, word.box) not in held
    )
    return replace(fine, loose=tuple(loose))


def _says_something(letter: str) -> bool:
    """Whether it is no mere stroke: rules are read as bars and dashes."""
    return letter.isalnum() or letter in "%#" or unicodedata.category(letter) == "Sc"


def _held(fine: FinePage) -> set[tuple[str, tuple[float, float, float, float]]]:
    """The words of all lines and figures."""
    held = {(word.text, word.box) for own in fine.words for word in own}
    return held | {(word.text, word.box) for zone in fine.others for word in zone.words}


def _rows(words: Sequence[Word]) -> Iterator[list[Word]]:
    """Words of one row without a wide space between them, from left to right."""
    for row in rows_of_words(words):
        part = row[:1]
        for word in row[1:]:
            if word.box[0] - part[-1].box[2] > _COLUMN_GAP * (part[0].box[3] - part[0].box[1]):
                yield part
                part = []
            part.append(word)
        yield part


def _hull(words: Sequence[Word]) -> NDArray[np.float64]:
    boxes = np.array([word.box for word in words])
    return np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])


def _line(box: NDArray[np.float64]) -> Line:
    """A line of a box on the working copy, as high as its capitals; its strokes are not known."""
    x0, y0, x1, y1 = box.tolist()
    height = max(y1 - y0, 1.0)
    return Line(
        np.empty(0, np.intp), (x0, y0, x1, y1), y1, height / CAPITAL_HEIGHT, 0.7 * height, 0.1 * height
    )


def _scraps(fine: FinePage, boxes: NDArray[np.float64]) -> set[int]:
    """Lines without words that lie for the most part in one of the boxes."""
    own = fine.boxes
    across = np.minimum(own[:, None, 2], boxes[:, 2]) - np.maximum(own[:, None, 0], boxes[:, 0])
    down = np.minimum(own[:, None, 3], boxes[:, 3]) - np.maximum(own[:, None, 1], boxes[:, 1])
    shared = (np.maximum(across, 0.0) * np.maximum(down, 0.0)).max(axis=1, initial=0.0)
    area = (own[:, 2] - own[:, 0]) * (own[:, 3] - own[:, 1])
    is_scrap = shared >= _COVERED * np.maximum(area, 1e-9)
    return {line for line in np.flatnonzero(is_scrap).tolist() if not fine.words[line]}
