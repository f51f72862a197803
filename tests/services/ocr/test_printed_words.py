"""Words that a file says are on its page, beside those that an engine reads there."""

import numpy as np
import pytest

from services.arrays import GrayImage
from services.ocr.engine import CERTAIN, Word
from services.ocr.printed_words import NOT_KNOWN, PrintedWords, believed_words
from services.ocr.word_trust import probability_right

SAID = "a line of some words"
PRINTED = PrintedWords((Word(SAID, (10.0, 10.0, 90.0, 20.0), CERTAIN, 0),))


def page() -> GrayImage:
    canvas = np.full((60, 100), 255, np.uint8)
    canvas[12:18, 12:88:4] = 0
    return canvas


class Reader:
    """Reads every line as `text`."""

    name = "scripted"

    def __init__(self, text: str, confidence: float) -> None:
        self.answer = text, confidence

    def read_page(self, image: GrayImage) -> list[Word]:
        raise AssertionError("lines are enough")

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        assert image.shape == (16, 86)
        return self.answer


def test_what_is_read_elsewhere_stays() -> None:
    read = [Word("garbled", (80.0, 5.0, 95.0, 12.0), 0.9, 0), Word("LOGO", (10.0, 30.0, 90.0, 50.0), 0.9, 0)]
    joined = PRINTED.joined(read)
    assert [(word.text, word.line) for word in joined] == [(SAID, 0), ("LOGO", 1)]
    assert PRINTED.joined(joined) == [*PRINTED.words, Word("LOGO", (10.0, 30.0, 90.0, 50.0), 0.9, 2)]
    assert NOT_KNOWN.joined(read) == read


@pytest.mark.parametrize(
    ("text", "confidence", "believed"),
    [
        ("A iine ofsome words", 0.95, True),
        ("Z khmd ne rnld vnqcr", 0.95, False),
        ("Z khmd ne rnld vnqcr", 0.4, True),
    ],
    ids=["read alike", "surely read otherwise", "not read"],
)
def test_words_that_an_engine_surely_reads_otherwise_are_not_believed(
    text: str, confidence: float, believed: bool
) -> None:
    found = believed_words(PRINTED, page(), Reader(text, confidence))
    assert found == (PRINTED if believed else NOT_KNOWN)


def test_words_that_are_not_seen_are_left_out() -> None:
    hidden = Word("white on white", (10.0, 30.0, 90.0, 40.0), CERTAIN, 1)
    both = PrintedWords((*PRINTED.words, hidden))
    assert believed_words(both, page(), None) == PRINTED


def test_a_word_of_the_file_is_right() -> None:
    assert probability_right(CERTAIN) == 1.0
