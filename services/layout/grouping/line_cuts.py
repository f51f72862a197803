"""Where a line of words is cut into parts: where a key ends, where a value begins or ends, and at wide spaces."""

import re
from collections.abc import Sequence, Set

from services.layout.graph.zone_words import words_of
from services.layout.page import ZoneWord
from services.layout.read_words import is_value
from services.ocr.engine import Word

_WIDE = 1.2
"""Space between two words, in em, that parts columns: words of a line are a third of an em apart."""
_KEY_END = re.compile(r"[:=°º]$|^[:=]+$")
_NUMBER = re.compile(r"\(\w{0,2}\d{4,}.*|\d{4,}-[A-Z]\)?")
"""A word that is a number behind a name: (139386, 273500-U."""
_THOUSANDS = re.compile(r"\(?-?\W?\d{1,3}")
_GROUPED = re.compile(r"\d{3}(?:[.,]\d{2}\)?)?")
"""What follows thousands that a space parts from it, as in 12 345,60."""
_CURRENCY = re.compile(r"[$€£¥₹₽]")
"""The sign of a currency that a space parts from its amount."""
_OF_ONE_NUMBER = 0.45
"""Largest space between thousands, and between a currency and its amount, in em."""


def places_of_cuts(
    words: Sequence[Word] | Sequence[ZoneWord], em: float, keys: Set[str] = frozenset()
) -> list[int]:
    """Places of the words, from left to right, before which their line is cut; `em` is its font size in their unit.

    `keys` are words that end a key of the class.
    """
    values = [is_value(word.text) or bool(_NUMBER.fullmatch(word.text.strip(".,;*"))) for word in words]
    joined = set()
    for at in range(len(words) - 1, 0, -1):
        near = words[at].box[0] - words[at - 1].box[2] < _OF_ONE_NUMBER * em
        if near and values[at] and _CURRENCY.fullmatch(words[at - 1].text):
            joined.add(at)
            values[at - 1] = True
        if near and (values[at] or at + 1 in joined) and _is_thousands(words[at - 1].text, words[at].text):
            joined.add(at)
            values[at - 1] = True
    return [
        at
        for at in range(1, len(words))
        if at not in joined
        and (
            words[at].box[0] - words[at - 1].box[2] > _WIDE * em
            or values[at] != values[at - 1]
            or (values[at] and values[at - 1])
            or (_KEY_END.search(words[at - 1].text) and not _KEY_END.search(words[at].text))
            or _ends_key(words[at - 1].text, keys)
        )
    ]


def _ends_key(word: str, keys: Set[str]) -> bool:
    return not keys.isdisjoint(words_of(word)[-1:]) if keys else False


def _is_thousands(word: str, after: str) -> bool:
    """Whether two words are one number, its thousands apart."""
    return bool(_THOUSANDS.fullmatch(word) and _GROUPED.fullmatch(after.strip(".,;*")))
