"""A page that reads poorly is read again, by a second reader or softer, and the better reading counts."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from services.arrays import GrayImage
from services.ocr.engine import Word
from services.ocr.softer_reading import ENLARGEMENT, read_best

PAGE = np.full((80, 120), 255, np.uint8)
PAGE[30:50, 20:100:4] = 120
BOX = (15.0, 30.0, 90.0, 60.0)


@dataclass
class Reader:
    """Reads a word a page, with these confidences in turn; each page takes no time, or all of it."""

    confidences: list[float]
    name: str = "scripted"
    pages: list[GrayImage] = field(default_factory=list)
    cut: bool = False

    def read_page(self, image: GrayImage) -> list[Word]:
        return self.read_page_within(image, 1.0)[0]

    def read_page_within(self, image: GrayImage, seconds: float) -> tuple[list[Word], bool]:
        assert seconds > 0
        self.pages.append(image)
        confidence = self.confidences[len(self.pages) - 1]
        return ([Word(f"reading{len(self.pages)}", BOX, confidence)] if confidence else []), self.cut

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        raise AssertionError("no line is read")


@pytest.mark.parametrize(
    ("confidences", "pages", "chosen"),
    [
        ([0.9], 1, "reading1"),
        ([0.6, 0.95], 2, "reading2"),
        ([0.75, 0.6], 2, "reading1"),
        ([0.3, 0.4, 0.9], 3, "reading3"),
        ([0.3, 0.4, 0.2], 3, "reading2"),
    ],
)
def test_the_reading_with_more_letters_to_be_right_counts(
    confidences: list[float], pages: int, chosen: str
) -> None:
    engine = Reader(confidences)
    words, cut = read_best(PAGE, engine, 100.0)
    assert (len(engine.pages), [word.text for word in words], cut) == (pages, [chosen], False)
    # Words lie where the page as it is has them.
    scale = 1.0 if chosen == "reading1" else ENLARGEMENT
    assert words[0].box == pytest.approx(tuple(edge / scale for edge in BOX))


def test_other_readings_are_larger_and_softer() -> None:
    engine = Reader([0.3, 0.3, 0.3])
    read_best(PAGE, engine, 100.0)
    first, gray, ink = engine.pages
    assert first is PAGE
    assert gray.shape == ink.shape == (120, 180)
    # Softened edges of stripes, and darker ones from black and white.
    assert 120 < gray.min() < 255
    assert len(np.unique(gray)) > 20
    assert ink.min() < gray.min()


def test_what_is_blank_or_was_cut_is_read_once() -> None:
    blank = Reader([0.0])
    assert read_best(PAGE, blank, 100.0) == ([], False)
    late = Reader([0.3], cut=True)
    words, cut = read_best(PAGE, late, 100.0)
    assert (len(words), cut, len(late.pages), len(blank.pages)) == (1, True, 1, 1)


@dataclass
class Assisted(Reader):
    """Has a second reader, or what it reads has none."""

    second: Reader | None = None

    def second_reader(self) -> Reader | None:
        return self.second


@pytest.mark.parametrize(
    ("first", "second", "pages", "chosen"),
    [(0.9, 0.95, 0, "page"), (0.82, 0.9, 1, "second"), (0.82, 0.7, 1, "page"), (0.0, 0.9, 1, "second")],
)
def test_a_second_reader_comes_in_place_of_softer_readings(
    first: float, second: float, pages: int, chosen: str
) -> None:
    other = Reader([second], "second")
    engine = Assisted([first], "page", second=other)
    words, cut = read_best(PAGE, engine, 100.0)
    assert (len(engine.pages), len(other.pages), cut) == (1, pages, False)
    assert [word.confidence for word in words] == [second if chosen == "second" else first]
    # Boxes are those of the page as it is.
    assert words[0].box == BOX


def test_a_second_reader_without_time_leaves_words_unread() -> None:
    engine = Assisted([0.6], "page", second=Reader([0.9], "second", cut=True))
    assert read_best(PAGE, engine, 100.0)[1]


def test_without_a_second_reader_it_is_read_softer() -> None:
    engine = Assisted([0.6, 0.95])
    assert [word.text for word in read_best(PAGE, engine, 100.0)[0]] == ["reading2"]


def test_what_was_cut_is_read_by_no_other() -> None:
    other = Reader([0.9])
    assert read_best(PAGE, Assisted([0.3], cut=True, second=other), 100.0)[1]
    assert other.pages == []
