"""Words of the OCR engine as words of zones: their confidence is the probability that they are right."""

from collections.abc import Sequence

from services.layout.page import ZoneWord
from services.ocr.engine import Word
from services.ocr.word_trust import probability_right


def read_words(lines: Sequence[Sequence[Word]]) -> tuple[ZoneWord, ...]:
    """Words of a zone's lines, numbered by line."""
    return tuple(
        ZoneWord(word.text, word.box, probability_right(word.confidence), row)
        for row, line in enumerate(lines)
        for word in line
    )
