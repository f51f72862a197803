"""Words of the OCR engine as words of zones: their confidence is the probability that they are right."""

import re
from collections.abc import Sequence

from services.layout.page import ZoneWord
from services.ocr.engine import Word
from services.ocr.word_trust import probability_right

_VALUE = re.compile(
    r"\d{1,4}([./-])\d{1,2}\1\d{1,4}|\d{1,2}:\d{2}(?::\d{2})?(?:[AaPp][Mm])?|\(?-?\W?\d[\d.,']*[.,]\d{2}\)?"
)


def is_value(word: str) -> bool:
    """Whether a word is a date, a time or an amount: a value of its own."""
    return bool(_VALUE.fullmatch(word.strip(".,;*")))


def read_words(lines: Sequence[Sequence[Word]]) -> tuple[ZoneWord, ...]:
    """Words of a zone's lines, numbered by line."""
    return tuple(
        ZoneWord(word.text, word.box, probability_right(word.confidence), row)
        for row, line in enumerate(lines)
        for word in line
    )
