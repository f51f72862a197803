"""Text of a page: blocks in reading order, their lines, their words."""

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from services.ocr.engine import Word
from services.ocr.word_trust import probability_right

Box = tuple[float, float, float, float]
"""(x0, y0, x1, y1) in pixels of the flat page, x1 > x0 and y1 > y0."""
Quadrilateral = tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]
"""Corners (x, y), clockwise from the top left one of the flat page."""
BlockKind = Literal["heading", "text"]

_RIGHT_TO_LEFT = frozenset({"R", "AL"})
_LEFT_TO_RIGHT = "L"
_UNSPACED = ("CJK", "HIRAGANA", "KATAKANA", "IDEOGRAPHIC", "FULLWIDTH")
"""First words of the Unicode names of letters that are written without spaces between words."""


@dataclass(frozen=True, slots=True)
class ReadLine:
    """One line, its words in the order of reading (from right to left in Arabic and Hebrew)."""

    words: tuple[Word, ...]

    @property
    def box(self) -> Box:
        """The box round its words."""
        return union_box([word.box for word in self.words])

    @property
    def text(self) -> str:
        """Its words with spaces between them, except in scripts that have none."""
        return join_words([word.text for word in self.words])

    @property
    def right_to_left(self) -> bool:
        """Whether most of its letters are of a script that is written from right to left."""
        return is_right_to_left(self.text)


@dataclass(frozen=True, slots=True)
class TextBlock:
    """One block of text (a paragraph, a heading), its lines from the top down. `level` is that of a heading, 1 or 2."""

    lines: tuple[ReadLine, ...]
    kind: BlockKind = "text"
    level: int = 0

    @property
    def box(self) -> Box:
        """The box round its lines."""
        return union_box([line.box for line in self.lines])


@dataclass(frozen=True, slots=True)
class PageText:
    """Text of a flat page of `width` x `height` pixels; blocks are in reading order.

    `language` is what the OCR engine read (`eng`, or `eng+fra`). `places` are the words' quadrilaterals in the photo,
    in the order of `words`; None for a word whose place the photo does not show. It is empty if the page is of no
    single photo. `cut`: the page was not read to its end, since the time was over.
    """

    width: int
    height: int
    language: str
    blocks: tuple[TextBlock, ...]
    places: tuple[Quadrilateral | None, ...] = field(default=())
    cut: bool = False

    @property
    def lines(self) -> tuple[ReadLine, ...]:
        """All lines in reading order."""
        return tuple(line for block in self.blocks for line in block.lines)

    @property
    def words(self) -> tuple[Word, ...]:
        """All words in reading order."""
        return tuple(word for line in self.lines for word in line.words)

    @property
    def confidence(self) -> float | None:
        """Mean probability that a word is right, weighted by their length; None if there are none."""
        letters = sum(len(word.text) for word in self.words)
        believed = sum(len(word.text) * probability_right(word.confidence) for word in self.words)
        return believed / letters if letters else None

    def resized(self, width: int, height: int) -> "PageText":
        """The text of the same page in another size; places in the photo stay."""
        if (width, height) == (self.width, self.height):
            return self
        x, y = width / self.width, height / self.height
        blocks = tuple(
            replace(block, lines=tuple(_resized_line(line, x, y) for line in block.lines))
            for block in self.blocks
        )
        return replace(self, width=width, height=height, blocks=blocks)


def _resized_line(line: ReadLine, x: float, y: float) -> ReadLine:
    boxes = [(word.box[0] * x, word.box[1] * y, word.box[2] * x, word.box[3] * y) for word in line.words]
    return ReadLine(tuple(replace(word, box=box) for word, box in zip(line.words, boxes, strict=True)))


def union_box(boxes: Sequence[Box]) -> Box:
    """The box round one box or more."""
    x0, y0, x1, y1 = zip(*boxes, strict=True)
    return min(x0), min(y0), max(x1), max(y1)


def doubtful_letters(words: Sequence[Word]) -> float:
    """Share of the letters that are in words that are probably wrong; 1 where nothing was read."""
    letters = sum(len(word.text) for word in words)
    right = sum(len(word.text) * probability_right(word.confidence) for word in words)
    return 1.0 - right / letters if letters else 1.0


def is_right_to_left(text: str) -> bool:
    """Whether more letters of `text` are written from right to left than from left to right."""
    kinds = [unicodedata.bidirectional(character) for character in text]
    return sum(kind in _RIGHT_TO_LEFT for kind in kinds) > kinds.count(_LEFT_TO_RIGHT)


def join_words(words: Sequence[str]) -> str:
    """The words in one string, with a space between two of them unless both are of a script without spaces."""
    parts: list[str] = []
    for word in words:
        if parts and needs_space(parts[-1], word):
            parts.append(" ")
        parts.append(word)
    return "".join(parts)


def needs_space(before: str, after: str) -> bool:
    """Whether a space stands between two neighbouring words of a line."""
    return not (_is_unspaced(before[-1:]) and _is_unspaced(after[:1]))


def _is_unspaced(character: str) -> bool:
    return bool(character) and unicodedata.name(character, "").startswith(_UNSPACED)
