"""Lines that the page reading lost: read again as lines, and only those."""

from dataclasses import replace

import numpy as np
import pytest

from services.arrays import GrayImage
from services.ocr.engine import Word
from services.ocr.lost_lines import MOST_VAIN, with_lost_lines
from tests.services.ocr.pages import blank, set_lines

HEIGHT = 36


class LineEngine:
    """Reads every line crop as one word over all of its ink."""

    name = "scripted"

    def __init__(self, confidence: float = 0.9) -> None:
        self.confidence = confidence
        self.crops: list[GrayImage] = []

    def read_page(self, image: GrayImage) -> list[Word]:
        """Nothing: the words of the page are given."""
        return []

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        """Not used here."""
        return "", 0.0

    def read_line_words(self, image: GrayImage) -> list[Word]:
        """One word, `read again`, from the first column with ink to the last."""
        self.crops.append(image)
        ink = np.flatnonzero((image < 128).any(axis=0))
        return [Word("read again", (ink[0], 0.0, ink[-1] + 1.0, image.shape[0]), self.confidence)]


class PageEngine:
    """An engine that cannot read lines as words."""

    name = "scripted"

    def read_page(self, image: GrayImage) -> list[Word]:
        """Nothing."""
        return []

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        """Nothing."""
        return "", 0.0


@pytest.fixture(scope="module")
def page() -> tuple[GrayImage, list[tuple[float, float, float, float]]]:
    """Three lines of print, and their boxes from the top down."""
    canvas = blank(1000, 360)
    boxes = set_lines(canvas, (60, 60), 3, HEIGHT, words=6)
    return np.asarray(canvas, dtype=np.uint8), [
        (float(x0), float(y0), float(x1), float(y1)) for x0, y0, x1, y1 in boxes
    ]


def read(box: tuple[float, float, float, float], confidence: float = 0.9) -> Word:
    """A line that the page reading took for one word."""
    return Word("first line read", box, confidence)


def test_a_lost_line_is_read_where_it_is(
    page: tuple[GrayImage, list[tuple[float, float, float, float]]],
) -> None:
    gray, boxes = page
    engine = LineEngine()
    found = with_lost_lines(gray, [read(boxes[0]), read(boxes[2])], engine)
    assert [word.text for word in found] == ["first line read", "first line read", "read again"]
    assert found[2].box == pytest.approx(boxes[1], abs=4)
    assert found[2].line == 0, "no other word has a line"
    assert len(engine.crops) == 1


def test_two_lines_in_one_row_are_read_apart(
    page: tuple[GrayImage, list[tuple[float, float, float, float]]],
) -> None:
    gray, boxes = page
    fused = (boxes[0][0], boxes[0][1], boxes[1][2], boxes[1][3])
    found = with_lost_lines(gray, [read(fused), read(boxes[2])], LineEngine())
    assert [word.text for word in found] == ["first line read", "read again", "read again"]
    assert [word.box for word in found[1:]] == [pytest.approx(box, abs=4) for box in boxes[:2]]


def test_an_unsure_line_gives_way_to_a_surer_reading(
    page: tuple[GrayImage, list[tuple[float, float, float, float]]],
) -> None:
    gray, boxes = page
    found = with_lost_lines(gray, [read(boxes[0]), read(boxes[1], 0.2), read(boxes[2])], LineEngine())
    assert [word.text for word in found] == ["first line read", "first line read", "read again"]


@pytest.mark.parametrize("engine", [LineEngine(confidence=0.4), PageEngine()])
def test_words_stay_without_a_sure_second_reading(
    page: tuple[GrayImage, list[tuple[float, float, float, float]]], engine: LineEngine | PageEngine
) -> None:
    gray, boxes = page
    words = [read(boxes[0]), read(boxes[2], 0.3)]
    assert with_lost_lines(gray, words, engine) == words


class TwoModes(LineEngine):
    """Reads words unsurely; as a whole line it reads `text`, surely."""

    def __init__(self, text: str) -> None:
        super().__init__(confidence=0.3)
        self.text = text

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        """The text of every line."""
        return self.text, 0.9

    def read_line_words(self, image: GrayImage) -> list[Word]:
        """Two words of one line."""
        (word,) = super().read_line_words(image)
        x0, y0, x1, y1 = word.box
        middle = (x0 + x1) / 2
        return [Word("read", (x0, y0, middle, y1), 0.3), Word("again", (middle, y0, x1, y1), 0.3)]


@pytest.mark.parametrize(
    ("words", "text", "added"), [(2, "read again", 2), (2, "red again", 0), (9, "read again", 0)]
)
def test_an_unsure_reading_of_a_short_line_counts_if_another_mode_says_the_same(
    words: int, text: str, added: int
) -> None:
    canvas = blank(1000, 360)
    set_lines(canvas, (60, 60), 1, HEIGHT, words=words)
    found = with_lost_lines(np.asarray(canvas, dtype=np.uint8), [], TwoModes(text))
    assert [word.confidence for word in found] == [0.9] * added


@pytest.mark.parametrize(("confidence", "readings"), [(0.9, 30), (0.3, MOST_VAIN)])
def test_lines_that_read_no_better_are_soon_left_alone(confidence: float, readings: int) -> None:
    canvas = blank(1000, 1800)
    set_lines(canvas, (60, 60), 30, HEIGHT, words=6)
    engine = LineEngine(confidence)
    with_lost_lines(np.asarray(canvas, dtype=np.uint8), [], engine)
    assert len(engine.crops) == readings


def test_a_line_is_read_again_as_a_whole(
    page: tuple[GrayImage, list[tuple[float, float, float, float]]],
) -> None:
    """The engine's line 4 was read unsurely in a part: it is replaced, and keeps its number."""
    gray, boxes = page
    x0, y0, x1, y1 = boxes[1]
    middle = (x0 + x1) / 2
    halves = [Word("unsure", (x0, y0, middle, y1), 0.2, 4), Word("sure", (middle + 9, y0, x1, y1), 0.9, 4)]
    words = [replace(read(boxes[0]), line=3), *halves, replace(read(boxes[2]), line=5)]
    found = with_lost_lines(gray, words, LineEngine())
    assert [(word.text, word.line) for word in found] == [
        ("first line read", 3),
        ("read again", 4),
        ("first line read", 5),
    ]


def test_no_line_is_read_after_the_time_is_over(
    page: tuple[GrayImage, list[tuple[float, float, float, float]]],
) -> None:
    engine = LineEngine()
    assert with_lost_lines(page[0], [], engine, ends_s=0.0) == []
    assert engine.crops == []


@pytest.mark.parametrize(("confidence", "most"), [(0.9, 0.4), (0.2, 1.0)])
def test_lines_that_were_read_in_part_are_read_again_up_to_a_share(confidence: float, most: float) -> None:
    """Of 30 lines of one length about 0.3 are, and all where nothing was surely read."""
    canvas = blank(1000, 1800)
    boxes = set_lines(canvas, (60, 60), 30, HEIGHT, words=6)
    words = [
        Word("half", (x0, y0, (x0 + x1) / 2, y1), confidence, k) for k, (x0, y0, x1, y1) in enumerate(boxes)
    ]
    engine = LineEngine()
    with_lost_lines(np.asarray(canvas, dtype=np.uint8), words, engine)
    assert 0.2 < len(engine.crops) / 30 <= most
    assert (len(engine.crops) == 30) == (most == 1.0)


def test_a_high_word_stays_with_the_words_of_its_line(
    page: tuple[GrayImage, list[tuple[float, float, float, float]]],
) -> None:
    """Its box reaches into the next line, which is read again."""
    gray, boxes = page
    (x0, y0, x1, y1), below = boxes[:2]
    high = Word("high", (x0, y0, x0 + 100, below[3]), 0.9, 0)
    words = [high, Word("rest", (x0 + 110, y0, x1, y1), 0.9, 0), replace(read(boxes[2]), line=2)]
    found = with_lost_lines(gray, words, LineEngine())
    assert [(word.text, word.line) for word in found] == [
        ("high", 0),
        ("rest", 0),
        ("first line read", 2),
        ("read again", 3),
    ]


@pytest.mark.parametrize(("covered", "readings"), [(0.5, 1), (0.7, 0)])
def test_a_line_is_lost_where_its_words_leave_much_of_it(
    page: tuple[GrayImage, list[tuple[float, float, float, float]]], covered: float, readings: int
) -> None:
    gray, boxes = page
    x0, y0, x1, y1 = boxes[1]
    part = Word("part", (x0, y0, x0 + covered * (x1 - x0), y1), 0.9)
    engine = LineEngine()
    with_lost_lines(gray, [read(boxes[0]), part, read(boxes[2])], engine)
    assert len(engine.crops) == readings
