"""What a zone says, and what stands beside and above it, as tokens that a class can learn from its samples.

No list of words comes with the code. A token is a word, a piece of one (so that a misread letter leaves others), the
form of a number, or the kind of value that a text looks like. Words that stand left of a zone in its row, or above it
in its column, are the keys of its value: TOTAL, Date, Kunde.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from services.layout.page import Page, Zone

WORD_ASPECTS = ("own-words", "own-letters", "own-forms", "words-left", "words-above")
"""What tokens are of: the zone's words, their letters, the forms of its values, the words of both neighbours."""

NOTHING = "-"
"""The token of a neighbour that is not there, and of a zone without a text."""
MOST_TOKENS = 40
"""Of one aspect of a zone, its first ones: a line has fewer words, and a paragraph is known by its beginning."""
LONGEST_TOKEN = 16
_SEARCHED = 600
"""Characters of a zone that are read for tokens."""
_SAME_ROW = 0.5
"""Common height of two zones of one row, as a share of the lower one's."""

_WORD = re.compile(r"[^\W\d_]{2,}")
_CHUNK = re.compile(r"\S+")
_KINDS: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("date", re.compile(r"(?<!\d)\d{1,4}([./-])\d{1,2}\1\d{1,4}(?!\d)")),
    (
        "named-date",
        re.compile(r"\d{1,2}\W{0,3}[^\W\d_]{3,9}\W{0,3}\d{2,4}|[^\W\d_]{3,9}\W{0,2}\d{1,2}\W{1,3}\d{4}"),
    ),
    ("time", re.compile(r"(?<!\d)\d{1,2}:\d{2}(?!\d)")),
    ("amount", re.compile(r"(?<![\d.,])\d{1,3}(?:[.,' ]?\d{3}){0,3}[.,]\d{2}(?!\d)")),
    ("percent", re.compile(r"\d\s?%")),
    ("currency", re.compile(r"[$€£¥₹₽]|(?<![^\W\d_])(?:[A-Z]{2,3})(?=\s?\d+[.,]\d{2})")),
    ("phone", re.compile(r"(?<![\w.])\+?\(?\d{2,4}\)?[ /-]\d{3}[\d -]{2,10}(?!\w)")),
    ("mail", re.compile(r"\S@\S")),
    ("web", re.compile(r"www\.|https?:")),
    ("postal-code", re.compile(r"(?<![\w.,/-])\d{4,6}(?![\w.,/-])")),
    ("long-number", re.compile(r"\d{7}")),
    ("identifier", re.compile(r"(?<!\w)(?=\w*\d)(?=\w*[A-Za-z])[\w/-]{5,}")),
)
"""Kinds of values, by what they look like. Whether a text has such a value is not decided here."""

Tokens = tuple[tuple[str, ...], ...]
"""Of one zone, by aspect: different tokens, in their order."""
Token = tuple[int, str]
"""Its aspect, as an index of `WORD_ASPECTS`, and itself."""


@dataclass(frozen=True, slots=True, eq=False)
class PageTokens:
    """The different `tokens` (T) of a page, and which row has which: `rows` and `columns` (M,) of `N * W` rows.

    Row z W + w is of zone z and aspect w.
    """

    tokens: tuple[Token, ...]
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]


NO_TOKENS = PageTokens((), np.zeros(0, np.intp), np.zeros(0, np.intp))
"""Of a page that was not read."""


def page_tokens(page: Page) -> PageTokens:
    """Tokens of all zones of a page, none where nothing was read."""
    place: dict[Token, int] = {}
    rows, columns = [], []
    for zone, own in enumerate(zone_tokens(page)):
        for aspect, texts in enumerate(own):
            rows += [zone * len(WORD_ASPECTS) + aspect] * len(texts)
            columns += [place.setdefault((aspect, text), len(place)) for text in texts]
    return PageTokens(tuple(place), np.array(rows, np.intp), np.array(columns, np.intp))


def zone_tokens(page: Page) -> tuple[Tokens, ...]:
    """Tokens of each zone of a page, none of any aspect where nothing was read."""
    if not any(zone.text.strip() for zone in page.zones):
        return ((),) * len(page.zones)
    left, above = _neighbours(page.zones)
    return tuple(
        (
            *_own_tokens(zone.text[:_SEARCHED]),
            _left_words(page.zones, k, left[k]),
            _above_words(page.zones, above[k]),
        )
        for k, zone in enumerate(page.zones)
    )


@lru_cache(maxsize=4096)  # other groupings of a page have most texts again
def _own_tokens(text: str) -> Tokens:
    if not text.strip():
        return ((NOTHING,),) * 3
    words = _words(text)
    first = [f"^{words[0]}", f"{words[-1]}$"] if words else []
    return _first((*first, *words)), _first(_pieces(words)), _first(_forms(text))


def _words(text: str) -> list[str]:
    return [match[0].casefold()[:LONGEST_TOKEN] for match in _WORD.finditer(text)][:MOST_TOKENS]


def _pieces(words: Sequence[str]) -> Iterator[str]:
    """Three letters in a row of each word, its ends marked."""
    for word in words:
        marked = f"^{word}$"
        yield from (marked[at : at + 3] for at in range(len(marked) - 2))


def _forms(text: str) -> Iterator[str]:
    """The kinds of values that a text looks like, how many words it has, and the forms of its first words."""
    yield from (f"={name}" for name, pattern in _KINDS if pattern.search(text))
    chunks = _CHUNK.findall(text)
    yield f"#{min(len(chunks), 8).bit_length()}"
    for chunk in chunks[:MOST_TOKENS]:
        yield _form(chunk)


def _form(chunk: str) -> str:
    """Digits as 0, a run of capitals as A, of small letters as a: "12/01/2018" is "00/00/0000"."""
    form = re.sub(r"\d", "0", chunk)
    form = re.sub(r"0{5,}", "00000", form)
    kinds = (
        "A" if each.isupper() else "a" if each.isalpha() else each for each in form if each.isprintable()
    )
    form = "".join(kinds)
    return re.sub(r"(A|a)\1+", r"\1", form)[:LONGEST_TOKEN]


def _first(tokens: Sequence[str] | Iterator[str]) -> tuple[str, ...]:
    return tuple(list(dict.fromkeys(tokens))[:MOST_TOKENS])


def _neighbours(zones: Sequence[Zone]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The nearest zone with a text left of each in its row, and above each in its column; -1 where there is none."""
    boxes = np.array([zone.box for zone in zones], dtype=np.float64)
    has_text = np.array([bool(zone.text.strip()) for zone in zones])
    x0, y0, x1, y1 = boxes.T
    heights, widths = y1 - y0, x1 - x0
    common = np.minimum(y1[:, None], y1) - np.maximum(y0[:, None], y0)
    beside = (common >= _SAME_ROW * np.minimum(heights[:, None], heights)) & has_text
    away = x0[:, None] - x1
    away = np.where(beside & (x0 < x0[:, None]) & (away > -0.5 * widths[:, None]), away, np.inf)
    over = (np.minimum(x1[:, None], x1) - np.maximum(x0[:, None], x0) > 0) & has_text
    up = y0[:, None] - y1
    up = np.where(over & (y0 < y0[:, None]) & (up > -0.5 * heights[:, None]), up, np.inf)
    return tuple(np.where(np.isfinite(each.min(axis=1)), each.argmin(axis=1), -1) for each in (away, up))  # type: ignore[return-value]


def _left_words(zones: Sequence[Zone], own: int, left: int) -> tuple[str, ...]:
    """Words of the left neighbour that stand in the rows of the zone."""
    if left < 0:
        return (NOTHING,)
    top, bottom = zones[own].box[1], zones[own].box[3]
    return _of_neighbour(zones[left], lambda y: top <= y <= bottom)


def _above_words(zones: Sequence[Zone], above: int) -> tuple[str, ...]:
    """Words of the last line of the neighbour above."""
    if above < 0:
        return (NOTHING,)
    zone = zones[above]
    return _first(_words(zone.text[-_SEARCHED:].rstrip().rpartition("\n")[2]))


def _of_neighbour(zone: Zone, is_beside: Callable[[float], bool]) -> tuple[str, ...]:
    words = [word.text for word in zone.words if is_beside((word.box[1] + word.box[3]) / 2)]
    found = _words(" ".join(words) if words else zone.text[:_SEARCHED])
    return _first([*found, *([f"{found[-1]}$"] if found else [])])
