"""Rows of print: the words of a page by the line that they are on, and what their texts look like."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from services.layout.page import Box, Page, ZoneWord
from services.layout.word_rows import rows_of_words

MOST_WORDS = 4000
"""Of a page that is searched for tables; a page of small print has half as many."""
EM = 1.35
"""Font size in heights of a word: capitals have 0.7 of it, words with a descender 0.93."""
_WIDE = 0.75
"""Space between cells of a row, in em; words of a cell are 0.3 em apart."""

_LETTERS = re.compile(r"[^\W\d_]+|[#%]")
_LONGEST_TOKEN = 16


@dataclass(frozen=True, slots=True)
class PrintedRow:
    """The words of one line over the whole width of a page, from left to right."""

    words: tuple[ZoneWord, ...]

    @property
    def top(self) -> float:
        return median(word.box[1] for word in self.words)

    @property
    def bottom(self) -> float:
        return median(word.box[3] for word in self.words)

    @property
    def middle(self) -> float:
        return (self.top + self.bottom) / 2


@dataclass(frozen=True, slots=True)
class Segment:
    """Words of a row that stand close together."""

    words: tuple[ZoneWord, ...]

    @property
    def box(self) -> Box:
        return box_of(self.words)

    @property
    def text(self) -> str:
        return " ".join(word.text for word in self.words)


def page_words(page: Page) -> list[ZoneWord]:
    """The words of a page; of a zone whose words are not known its lines, as if they were words of one height."""
    words = list(page.loose)
    for zone in page.zones:
        if zone.words:
            words += zone.words
        elif zone.kind == "text" and zone.text.strip():
            lines = zone.text.splitlines()
            x0, y0, x1, y1 = zone.box
            step = (y1 - y0) / len(lines)
            words += [
                ZoneWord(line.strip(), (x0, y0 + k * step, x1, y0 + (k + 1) * step), 1.0, k)
                for k, line in enumerate(lines)
                if line.strip()
            ]
    return words[:MOST_WORDS]


def em_of(words: Sequence[ZoneWord]) -> float:
    """The usual font size of words, in pixels; 1 without any."""
    return EM * median(word.box[3] - word.box[1] for word in words) if words else 1.0


def printed_rows(words: Iterable[ZoneWord]) -> list[PrintedRow]:
    """The rows of words, from the top down."""
    rows = (PrintedRow(tuple(row)) for row in rows_of_words(words))
    return sorted(rows, key=lambda row: row.middle)


def segments_of(row: PrintedRow, em: float) -> list[Segment]:
    """The row's words where no wide space parts them; `em` is the page's font size."""
    runs: list[list[ZoneWord]] = []
    for word in row.words:
        if runs and word.box[0] - max(each.box[2] for each in runs[-1]) <= _WIDE * em:
            runs[-1].append(word)
        else:
            runs.append([word])
    return [Segment(tuple(run)) for run in runs]


def header_words(text: str) -> list[str]:
    """Words of a header in small letters, and the signs that stand for words there."""
    return [word.casefold()[:_LONGEST_TOKEN] for word in _LETTERS.findall(text)]


def box_of(words: Sequence[ZoneWord]) -> Box:
    """The box of one or more words."""
    x0, y0, x1, y1 = zip(*(word.box for word in words), strict=True)
    return min(x0), min(y0), max(x1), max(y1)
