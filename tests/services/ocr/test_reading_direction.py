"""Letters of a word from left to right on the page -> in the order of reading."""

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.ocr.reading_direction import order_letters
from services.ocr.tesseract import TesseractEngine

HEBREW = "שלום"
ARABIC = "الماء"


@pytest.mark.parametrize(
    ("seen", "read"),
    [
        ("water", "water"),
        ("12/5", "12/5"),
        ("", ""),
        (HEBREW[::-1], HEBREW),
        (ARABIC[::-1], ARABIC),
        (f".{ARABIC[::-1]}", f"{ARABIC}."),
        (f"({HEBREW[::-1]})", f"({HEBREW})"),
        (f"«{HEBREW[::-1]}", f"{HEBREW}»"),
        (f"12/5{HEBREW[::-1]}", f"{HEBREW}12/5"),
        (f"50%{HEBREW[::-1]}", f"{HEBREW}50%"),
        (f"abc-{HEBREW[::-1]}", f"{HEBREW}-abc"),
        ("ב\u05b8א", "אב\u05b8"),
    ],
)
def test_words_are_turned_as_they_are_read(seen: str, read: str) -> None:
    assert order_letters(seen) == read


@given(st.text(alphabet=HEBREW + ARABIC + "().,«»", max_size=12))
def test_turning_twice_gives_the_word_again(word: str) -> None:
    assert order_letters(order_letters(word)) == word


@given(st.text(max_size=12))
def test_no_letter_is_lost(word: str) -> None:
    assert len(order_letters(word)) == len(word)


class _Iterator:
    """A word iterator of Tesseract that has one word, its letters from left to right."""

    def __init__(self, text: str) -> None:
        self._text = text

    def BoundingBox(self, level: int) -> tuple[int, int, int, int]:
        return 10, 20, 50, 40

    def IsAtBeginningOf(self, level: int) -> bool:
        return True

    def Empty(self, level: int) -> bool:
        return False

    def Confidence(self, level: int) -> float:
        return 90.0

    def GetUTF8Text(self, level: int) -> str:
        return f"{self._text} "


def test_the_engine_gives_words_as_they_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    found = _Iterator(ARABIC[::-1])
    library = SimpleNamespace(
        RIL=SimpleNamespace(WORD=3, TEXTLINE=2), iterate_level=lambda words, level: [words]
    )
    engine = object.__new__(TesseractEngine)
    monkeypatch.setattr(engine, "_library", library, raising=False)
    api = SimpleNamespace(GetIterator=lambda: found)
    assert [word.text for word in engine._words(api, 1.0)] == [ARABIC]
