"""Lone numbers of columns that the page reading lost."""

import cv2
import numpy as np
import pytest

from services.arrays import GrayImage
from services.ocr.engine import Word
from services.ocr.lost_numbers import with_lost_numbers

ROWS = (100, 160, 220)
LEFT, COLUMN, RIGHT = 60, 400, 600


class DigitEngine:
    """Reads every crop as the text it was made with."""

    name = "scripted"

    def __init__(self, text: str = "7", confidence: float = 0.95) -> None:
        self.text, self.confidence = text, confidence
        self.crops: list[GrayImage] = []

    def read_page(self, image: GrayImage) -> list[Word]:
        """Nothing: the words of the page are given."""
        return []

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        """The text."""
        self.crops.append(image)
        return self.text, self.confidence


def ink(gray: GrayImage, x: int, y: int, width: int) -> tuple[float, float, float, float]:
    """Print at a place, 20 px high, and its box."""
    cv2.rectangle(gray, (x, y), (x + width - 1, y + 19), 0, -1)
    return float(x), float(y), float(x + width), float(y + 20)


def page(numbers: int = 1, shift: int = 0) -> tuple[GrayImage, list[Word]]:
    """Three rows of a text, a quantity and an amount; only the first `numbers` quantities were read."""
    gray = np.full((320, 800), 255, np.uint8)
    words = []
    for line, y in enumerate(ROWS):
        words.append(Word("bolt", ink(gray, LEFT, y, 80), 0.95, line))
        box = ink(gray, COLUMN + (shift if line >= numbers else 0), y, 14)
        if line < numbers:
            words.append(Word("3", box, 0.95, line))
        words.append(Word("12.00", ink(gray, RIGHT, y, 70), 0.95, line))
    return gray, words


def test_a_number_that_a_column_lacks_is_read_where_it_is() -> None:
    gray, words = page(numbers=2)
    found = with_lost_numbers(gray, words, DigitEngine())
    assert [word.text for word in found[-3:]] == ["bolt", "7", "12.00"]
    assert found[-2].box == (COLUMN, ROWS[2], COLUMN + 14, ROWS[2] + 20)
    assert found[-2].line == found[-3].line == 2
    assert [word for word in found if word.text != "7"] == words


def test_a_whole_column_may_be_lost() -> None:
    found = with_lost_numbers(*page(numbers=0), DigitEngine())
    assert [word.text for word in found] == ["bolt", "7", "12.00"] * 3


def test_a_number_left_of_all_words_comes_before_them() -> None:
    gray, words = page(numbers=3)
    for y in ROWS:
        ink(gray, 10, y, 14)
    found = with_lost_numbers(gray, words, DigitEngine())
    assert [word.text for word in found] == ["7", "bolt", "3", "12.00"] * 3


@pytest.mark.parametrize(
    ("again", "confidence", "expected"),
    [
        ("12.00 €", 0.6, ["12.00 €"]),
        ("72.00", 0.9, ["72.00"]),
        ("72.00", 0.6, ["12.00", "€"]),
        ("12.00 €", 0.2, ["12.00", "€"]),
    ],
)
def test_an_amount_that_was_read_and_not_believed_is_read_again(
    again: str, confidence: float, expected: list[str]
) -> None:
    gray, words = page(numbers=3)
    x0, y0, x1, y1 = words[-1].box
    doubted = [Word("12.00", (x0, y0, x1 - 16, y1), 0.2, 2), Word("€", (x1 - 12, y0, x1, y1), 0.2, 2)]
    found = with_lost_numbers(gray, [*words[:-1], *doubted], DigitEngine(again, confidence))
    assert [word.text for word in found][8:] == expected
    assert found[:8] == words[:8]


@pytest.mark.parametrize("engine", [DigitEngine("l"), DigitEngine("7", 0.5), DigitEngine("")])
def test_what_is_no_sure_number_stays_unread(engine: DigitEngine) -> None:
    gray, words = page(numbers=2)
    assert with_lost_numbers(gray, words, engine) == words
    assert len(engine.crops) == 1


def test_print_beside_a_word_or_below_nothing_is_not_looked_at() -> None:
    engine = DigitEngine()
    gray, words = page(numbers=2, shift=90)
    assert with_lost_numbers(gray, words, engine) == words, "below nothing"
    gray, words = page(numbers=3)
    ink(gray, LEFT + 88, ROWS[0], 14)
    ink(gray, LEFT + 88, ROWS[1], 14)
    assert with_lost_numbers(gray, words, engine) == words, "as near as words of a text are"
    assert engine.crops == []


def test_nothing_is_read_when_the_time_is_over_and_forty_places_at_most() -> None:
    gray, words = page(numbers=2)
    engine = DigitEngine()
    assert with_lost_numbers(gray, words, engine, ends_s=0.0) == words
    assert engine.crops == []
    gray = np.full((3000, 800), 255, np.uint8)
    many = [Word("bolt", ink(gray, x, 40 * k, 80), 0.9) for k in range(60) for x in (LEFT, 200)]
    for k in range(60):
        ink(gray, COLUMN, 40 * k, 14)
    with_lost_numbers(gray, many, engine)
    assert len(engine.crops) == 40


def test_a_page_without_words_stays_empty() -> None:
    gray, _ = page()
    assert with_lost_numbers(gray, [], DigitEngine()) == []
