"""Rows of print: the words of a page by the line that they are on, and what their texts look like."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from services.layout.graph.zone_words import LONGEST_TOKEN
from services.layout.page import Box, Page, ZoneWord

MOST_WORDS = 4000
"""Of a page that is searched for tables; a page of small print has half as many."""
EM = 1.35
"""Font size in heights of a word: capitals have 0.7 of it, words with a descender 0.93."""
_SAME_ROW = 0.5
"""Common height of two words of a row, as a share of the lower one's."""
_WIDE = 0.75
"""Space between cells of a row, in em; words of a cell are 0.3 em apart."""

_NUMBER = r"[-−–(]?\d{1,3}(?:[.,'’ \u00a0\u202f]?\d{3})*"
_SIGN = r"(?:[A-Z]{3}|[^\W\d_]{0,2}[$€£¥₹]|kr|Kč|zł|Fr\.?)"
_KINDS: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("integer", re.compile(rf"{_NUMBER}")),
    ("percent", re.compile(r"\d{1,3}(?:[.,]\d{1,2})?\s?%")),
    ("amount", re.compile(rf"(?:{_SIGN}\s?)?{_NUMBER}[.,]\d{{2}}\)?(?:\s?{_SIGN})?|{_NUMBER},[-–—]{{1,2}}")),
    ("amount", re.compile(rf"{_SIGN}\s?{_NUMBER}|{_NUMBER}\s?{_SIGN}")),
    ("decimal", re.compile(rf"{_NUMBER}[.,]\d{{1,4}}")),
    ("date", re.compile(r"\d{1,4}([./-])\d{1,2}\1\d{1,4}")),
    ("code", re.compile(r"(?=\S*\d)\S{3,}")),
    ("short", re.compile(r"\S{1,4}")),
)
KINDS = ("integer", "percent", "amount", "decimal", "date", "code", "short", "words")
NUMERIC = frozenset(("integer", "amount", "decimal", "percent"))
"""Kinds of texts that are a number."""
_LETTERS = re.compile(r"[^\W\d_]+|[#%]")


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
    """The rows of words, from the top down.

    From the left each word is put to the row whose last word is most at its height, so that rows may slant.
    """
    rows: list[list[ZoneWord]] = []
    for word in sorted(words, key=lambda each: each.box[0]):
        y0, y1 = word.box[1], word.box[3]
        best, most = None, _SAME_ROW
        for row in rows:
            a, b = row[-1].box[1], row[-1].box[3]
            common = (min(y1, b) - max(y0, a)) / max(1e-6, min(y1 - y0, b - a))
            if common > most:
                best, most = row, common
        if best is None:
            rows.append([word])
        else:
            best.append(word)
    return sorted((PrintedRow(tuple(row)) for row in rows), key=lambda row: row.middle)


def segments_of(row: PrintedRow, em: float) -> list[Segment]:
    """The row's words where no wide space parts them; `em` is the page's font size."""
    runs: list[list[ZoneWord]] = []
    for word in row.words:
        if runs and word.box[0] - max(each.box[2] for each in runs[-1]) <= _WIDE * em:
            runs[-1].append(word)
        else:
            runs.append([word])
    return [Segment(tuple(run)) for run in runs]


def kind_of(text: str) -> str:
    """Which of `KINDS` a text looks like."""
    plain = " ".join(text.split())
    return next((name for name, pattern in _KINDS if pattern.fullmatch(plain)), "words")


def header_words(text: str) -> list[str]:
    """Words of a header in small letters, and the signs that stand for words there."""
    return [word.casefold()[:LONGEST_TOKEN] for word in _LETTERS.findall(text)]


def box_of(words: Sequence[ZoneWord]) -> Box:
    """The box of one or more words."""
    x0, y0, x1, y1 = zip(*(word.box for word in words), strict=True)
    return min(x0), min(y0), max(x1), max(y1)
