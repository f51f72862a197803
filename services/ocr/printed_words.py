"""Words that the file of a page says it prints: they take the place of what an engine reads there."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher

import numpy as np

from services.arrays import GrayImage
from services.ocr.engine import OcrEngine, Word
from services.ocr.softer_reading import READS_POORLY

_LEAST_CONTRAST = 8
"""Gray levels in the box of a word that is seen; hidden text is of the colour of its ground, or under a rectangle."""
_LINES_COMPARED = 3
"""The longest lines of a page, which an engine reads to see whether its file says what is there."""
_MOST_COMPARED = 200
"""Letters of a line, its first ones: the time of a comparison grows with the product of both lengths."""
_ALIKE = 0.5
"""Share of letters in common of two texts of one line; two texts that have nothing to do with each other have 0.3."""


@dataclass(frozen=True, slots=True)
class PrintedWords:
    """The words that a page prints, boxes in its pixels; without any they are not known.

    `is_all`: there is no other print on it, so that no engine need read it.
    """

    words: tuple[Word, ...] = ()
    is_all: bool = False

    def joined(self, read: Sequence[Word]) -> list[Word]:
        """These words, and those that an engine read where none of these lie."""
        if not self.words:
            return list(read)
        x0, y0, x1, y1 = np.array([word.box for word in self.words]).T
        first = 1 + max(word.line or 0 for word in self.words)
        others = [
            replace(word, line=None if word.line is None else word.line + first)
            for word in read
            if not np.any((word.box[0] < x1) & (word.box[2] > x0) & (word.box[1] < y1) & (word.box[3] > y0))
        ]
        return [*self.words, *others]


NOT_KNOWN = PrintedWords()


def believed_words(printed: PrintedWords, gray: GrayImage, engine: OcrEngine | None) -> PrintedWords:
    """The words of a page `gray` (H, W) that are seen on it; none if an engine surely reads others there.

    Some programs write fonts whose map to Unicode names other characters than they show.
    """
    seen = replace(printed, words=tuple(word for word in printed.words if _is_seen(word, gray)))
    return NOT_KNOWN if engine is not None and _is_contradicted(seen.words, gray, engine) else seen


def _is_seen(word: Word, gray: GrayImage) -> bool:
    x0, y0, x1, y1 = word.box
    pixels = gray[int(y0) : int(np.ceil(y1)), int(x0) : int(np.ceil(x1))]
    return pixels.size > 0 and int(pixels.max()) - int(pixels.min()) >= _LEAST_CONTRAST


def _is_contradicted(words: Sequence[Word], gray: GrayImage, engine: OcrEngine) -> bool:
    lines: dict[int | None, list[Word]] = defaultdict(list)
    for word in words:
        lines[word.line].append(word)
    longest = sorted(lines.values(), key=lambda line: -sum(len(word.text) for word in line))[:_LINES_COMPARED]
    return 2 * sum(_reads_otherwise(line, gray, engine) for line in longest) > len(longest)


def _reads_otherwise(line: Sequence[Word], gray: GrayImage, engine: OcrEngine) -> bool:
    left, top, right, bottom = zip(*(word.box for word in line), strict=True)
    y0, y1 = min(top), max(bottom)
    around = (y1 - y0) / 4
    rows, columns = gray.shape
    part = gray[
        max(0, int(y0 - around)) : min(rows, int(np.ceil(y1 + around))),
        max(0, int(min(left) - around)) : min(columns, int(np.ceil(max(right) + around))),
    ]
    read, confidence = engine.read_line(np.ascontiguousarray(part))
    if confidence < READS_POORLY:
        return False
    said, seen = (
        "".join(words).casefold()[:_MOST_COMPARED] for words in ([w.text for w in line], read.split())
    )
    return SequenceMatcher(None, seen, said, autojunk=False).ratio() < _ALIKE
