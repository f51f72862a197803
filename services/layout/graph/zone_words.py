"""The words of a zone, and those beside and above it, as tokens that a class learns from its samples.

No list of words comes with the code. A token is a word, a piece of one (so that a misread letter leaves others), the
form of a number, or the kind of value that a text looks like. Words that stand left of a zone in its row, or above it
in its column, are the keys of its value: TOTAL, Date, Kunde.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from services.contract.boxes import SAME_ROW
from services.layout.page import Box, Page
from services.layout.values.kinds import kinds_within

KEY_LEFT, KEY_ABOVE = "words-left", "words-above"
WORD_ASPECTS = ("own-words", "own-letters", "own-forms", KEY_LEFT, KEY_ABOVE)
"""What tokens are of: the zone's words, their letters, the forms of its values, the words of both neighbours."""

NOTHING = "-"
"""The token of a neighbour that is not there, and of a zone without a text."""
MOST_TOKENS = 40
"""Of one aspect of a zone, its first ones: a line has fewer words, and a paragraph is known by its beginning."""
LONGEST_TOKEN = 16
_SEARCHED = 600
"""Characters of a zone that are read for tokens."""
_SLACK = 0.3
"""Largest overlap of a zone and one beside it, in heights of the zone."""
_SAME_KEY = 3.0
"""Widest space within a key, in heights of the zone."""

_WORD = re.compile(r"[^\W\d_]{2,}")
_CHUNK = re.compile(r"\S+")

_UNIT = re.compile(r"[A-Z]{2,3}\.?|[$€£¥₹₽:=]|\d{1,2}(?:[.,]\d{1,2})?\s?%")
"""What stands between a key and its value: a currency, a rate, a colon."""

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


def page_tokens(page: Page, printed: Page | None = None) -> PageTokens:
    """Tokens of all zones of a page, none where nothing was read.

    `printed` is the same page with all of its print, where the zones of `page` are only some of it; None: `page`.
    """
    place: dict[Token, int] = {}
    rows, columns = [], []
    for zone, own in enumerate(zone_tokens(page, printed)):
        for aspect, texts in enumerate(own):
            rows += [zone * len(WORD_ASPECTS) + aspect] * len(texts)
            columns += [place.setdefault((aspect, text), len(place)) for text in texts]
    return PageTokens(tuple(place), np.array(rows, np.intp), np.array(columns, np.intp))


def zone_tokens(page: Page, printed: Page | None = None) -> tuple[Tokens, ...]:
    """Tokens of each zone of a page, none of any aspect where nothing was read; see `page_tokens`."""
    if not any(zone.text.strip() for zone in page.zones):
        return ((),) * len(page.zones)
    print_ = _Print.of(page if printed is None else printed)
    return tuple(
        (*_own_tokens(zone.text[:_SEARCHED]), print_.left_of(zone.box), print_.above(zone.box))
        for zone in page.zones
    )


def key_zones(page: Page) -> tuple[Mapping[str, int], ...]:
    """Of each zone the places of the zones that have its keys, by aspect: the next one to its left and above it.

    An aspect is missing where no other zone stands there.
    """
    print_ = _Print.of(page)
    found = []
    for place, zone in enumerate(page.zones):
        aspects = ((KEY_LEFT, print_.in_row(zone.box)), (KEY_ABOVE, print_.next_above(zone.box)))
        keys = {aspect: print_.zones[near[0]] for aspect, near in aspects if near}
        found.append({aspect: key for aspect, key in keys.items() if key != place})
    return tuple(found)


@lru_cache(maxsize=4096)  # other groupings of a page have most texts again
def _own_tokens(text: str) -> Tokens:
    if not text.strip():
        return ((NOTHING,),) * 3
    words = words_of(text)
    first = [f"^{words[0]}", f"{words[-1]}$"] if words else []
    return _first((*first, *words)), _first(_pieces(words)), _first(_forms(text))


def words_of(text: str) -> list[str]:
    """The words of a text as tokens, its first ones."""
    return [match[0].casefold()[:LONGEST_TOKEN] for match in _WORD.finditer(text)][:MOST_TOKENS]


def _pieces(words: Sequence[str]) -> Iterator[str]:
    """Three letters in a row of each word, its ends marked."""
    for word in words:
        marked = f"^{word}$"
        yield from (marked[at : at + 3] for at in range(len(marked) - 2))


def _forms(text: str) -> Iterator[str]:
    """The kinds of values that a text looks like, how many words it has, and the forms of its first words."""
    yield from _kinds(text)
    chunks = _CHUNK.findall(text)
    yield f"#{min(len(chunks), 8).bit_length()}"
    for chunk in chunks[:MOST_TOKENS]:
        yield _form(chunk)


def _kinds(text: str) -> Iterator[str]:
    return (f"={name}" for name in kinds_within(text))


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
    return tuple(islice((token for token in dict.fromkeys(tokens) if token), MOST_TOKENS))


@dataclass(frozen=True, slots=True, eq=False)
class _Print:
    """What is printed on a page: `boxes` (P, 4) of words, or of zones whose words are not known, and their `texts`."""

    texts: tuple[str, ...]
    boxes: NDArray[np.float64]
    zones: tuple[int, ...]
    """Of each of them the place of its zone."""

    @classmethod
    def of(cls, page: Page) -> "_Print":
        texts: list[str] = []
        boxes: list[Box] = []
        zones: list[int] = []
        for place, zone in enumerate(page.zones):
            if zone.words:
                texts += [word.text for word in zone.words]
                boxes += [word.box for word in zone.words]
            elif zone.text.strip():
                texts.append(zone.text[:_SEARCHED])
                boxes.append(zone.box)
            zones += [place] * (len(texts) - len(zones))
        return cls(tuple(texts), np.array(boxes, dtype=np.float64).reshape(-1, 4), tuple(zones))

    def left_of(self, box: Box) -> tuple[str, ...]:
        """Words in the row of a box and left of it, up to the next value: its key, if it has one there."""
        x0, _, x1, _ = self.boxes.T
        words: list[str] = []
        edge = box[0]
        for place in self.in_row(box):
            text = self.texts[place]
            if _UNIT.fullmatch(text):
                edge = x0[place]
                continue
            found = words_of(text)
            if words and (not found or edge - x1[place] > _SAME_KEY * (box[3] - box[1])):
                break
            words = [*found, *words]
            edge = x0[place]
        return _first([*words, f"{words[-1]}$"]) if words else (NOTHING,)

    def above(self, box: Box) -> tuple[str, ...]:
        """Words of the nearest row above a box in its column, and the kinds of values that it looks like."""
        row = self.next_above(box)
        if not row:
            return (NOTHING,)
        text = " ".join(self.texts[place].rstrip().rpartition("\n")[2] for place in row)
        return _first((*words_of(text), *_kinds(text)))

    def in_row(self, box: Box) -> list[int]:
        """Places of what stands left of a box in its row, from right to left."""
        x0, y0, x1, y1 = self.boxes.T
        height = box[3] - box[1]
        common = np.minimum(y1, box[3]) - np.maximum(y0, box[1])
        is_left = (common >= SAME_ROW * np.minimum(y1 - y0, height)) & (x1 <= box[0] + _SLACK * height)
        return [int(place) for place in np.flatnonzero(is_left)[np.argsort(-x0[is_left], kind="stable")]]

    def next_above(self, box: Box) -> list[int]:
        """Places of the nearest row above a box in its column, from left to right."""
        x0, _, x1, y1 = self.boxes.T
        slack = _SLACK * (box[3] - box[1])
        over = (np.minimum(x1, box[2]) - np.maximum(x0, box[0]) > 0) & (y1 <= box[1] + slack)
        if not over.any():
            return []
        row = np.flatnonzero(over & (y1 >= y1[over].max() - slack))
        return [int(place) for place in row[np.argsort(x0[row])]]
