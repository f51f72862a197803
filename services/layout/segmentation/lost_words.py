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
from services.layout.segmentation.fine_page import FinePage, hull
from services.layout.segmentation.frame import LevelledFrame
from services.layout.segmentation.measures import SAME_ROW
from services.layout.segmentation.text_lines import CAPITAL_HEIGHT, Line
from services.layout.segmentation.words import is_sign, is_word
from services.layout.word_rows import rows_of_words
from services.ocr.engine import MADE_UP, Word

_SURE = 0.6
"""Least confidence of a word that is believed without a line."""
_MANY = 0.1
"""Share of the sure words that have no line, from which on the components are not believed. On letters in which a
signature or a stamp covers print it is up to 15 %."""
_FEW = 5
_SURE_VALUE = 0.9
"""Least confidence of a date, time or amount that is believed though few words have no line: they are what forms are
read for, and print that only looks like a letter is never one."""
_COLUMN_GAP = 2.0
"""Space between two words that parts lines, in heights of the words."""
_WORD_SPACE = 1.0
"""Largest space between words of a line, in heights of the larger one; ..."""
_LIKE_HEIGHT = 1.6
"""... and the largest ratio of their heights."""
_COVERED = 0.5
"""Share of a line without words from which on it is a scrap of the lines that were read."""


def believes_words(fine: FinePage, words: Sequence[Word] | None) -> bool:
    """Whether much of what was read has no line on the page, so that its words are to make the lines."""
    sure = _sure(words)
    lost = [word for word in _lost(fine, words) if not is_sign(word)]
    return len(lost) >= _FEW and _letters(lost) >= _MANY * _letters(sure)


def with_lost_words(fine: FinePage, words: Sequence[Word] | None, frame: LevelledFrame) -> FinePage:
    """The page with lines of the `words` that no line and no figure has, each a block.

    A word beside a line that was read is one of this line. Of the others, where they are few, only sure values are
    taken; where there are none, it is the same page.
    """
    believed = believes_words(fine, words)
    fine = _with_words_beside(fine, _lost(fine, words), frame)
    lost = [word for word in _lost(fine, words) if not is_sign(word)]
    if not believed:
        lost = [word for word in lost if word.confidence >= _SURE_VALUE and is_value(word.text)]
    if not lost:
        return fine
    rows = list(_rows(lost))
    boxes = np.array([hull([word.box for word in row]) for row in rows])
    lines = [_line(box) for box in frame.level(boxes / np.array([*frame.scale, *frame.scale]))]
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


def _with_words_beside(fine: FinePage, lost: Sequence[Word], frame: LevelledFrame) -> FinePage:
    """The page whose read lines have the `lost` words that stand right beside their own, as part of the same row."""
    longer: dict[int, list[Word]] = {}
    left = list(lost)
    for line, own in enumerate(fine.words):
        if not own:
            continue
        words = list(own)
        while beside := [word for word in left if _is_beside(word, words)]:
            words += beside
            left = [word for word in left if word not in beside]
        words.sort(key=lambda word: word.box[0])
        ends = [place for place, word in enumerate(words) if not is_sign(word) or word in own]
        if len(words[ends[0] : ends[-1] + 1]) > len(own):
            longer[line] = words[ends[0] : ends[-1] + 1]
    if not longer:
        return fine
    boxes, lines, texts, words_of = fine.boxes.copy(), list(fine.lines), list(fine.texts), list(fine.words)
    for line, words in longer.items():
        added = np.array([word.box for word in words if word not in fine.words[line]])
        boxes[line] = hull([*fine.boxes[line : line + 1], *added])
        levelled = frame.level(added / np.array([*frame.scale, *frame.scale]))
        lines[line] = replace(lines[line], box=hull([lines[line].box, *levelled]))
        texts[line], words_of[line] = " ".join(word.text for word in words), tuple(words)
    return replace(fine, boxes=boxes, lines=tuple(lines), texts=tuple(texts), words=tuple(words_of))


def _is_beside(word: Word, row: Sequence[Word]) -> bool:
    """Whether a word stands next to one of a row, as high as that and on its level."""
    x0, y0, x1, y1 = word.box
    for each in row:
        a0, b0, a1, b1 = each.box
        low, high = sorted((y1 - y0, b1 - b0))
        if is_sign(word) or is_sign(each):
            low = high = max(low, high)
        near = max(x0 - a1, a0 - x1) <= _WORD_SPACE * high
        level = abs(y0 + y1 - b0 - b1) / 2 <= SAME_ROW * high
        if near and level and high <= _LIKE_HEIGHT * low:
            return True
    return False


def _lost(fine: FinePage, words: Sequence[Word] | None) -> list[Word]:
    """Sure words, and signs, that no line and no figure has."""
    held = _held(fine)
    signs = [word for word in words or () if is_sign(word)]
    return [word for word in (*_sure(words), *signs) if (word.text, word.box) not in held]


def _sure(words: Sequence[Word] | None) -> list[Word]:
    return [word for word in words or () if word.confidence >= _SURE and is_word(word)]


def _letters(words: Sequence[Word]) -> int:
    return sum(len(word.text) for word in words)


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
