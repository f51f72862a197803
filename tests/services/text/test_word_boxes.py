"""Boxes of one line's words: none spans another, no word is there twice."""

import pytest

from services.ocr.engine import Word
from services.text.word_boxes import settle_boxes, with_common_rows
from tests.services.text.pages import rows_of_words


def word(text: str, x0: float, x1: float, confidence: float = 0.9) -> Word:
    return Word(text, (x0, 0.0, x1, 40.0), confidence)


def test_a_box_that_spans_its_neighbours_keeps_its_widest_free_part() -> None:
    # Printed from right to left; the box of the fourth word begins at that of the second.
    first, second, third = word("في", 470, 494), word("طريقه", 388, 453), word("إلى", 340, 376)
    spanning = word("البحر", 254, 454)
    settled = settle_boxes([spanning, first, second, third])
    assert settled[1:] == [first, second, third]
    assert settled[0].box == pytest.approx((254, 0, 340 - 0.12 * 40, 40)), "a gap is left for the space"
    (line,) = rows_of_words([first, spanning, second, third])
    assert line.text == "في طريقه إلى البحر"


def test_neighbours_that_touch_or_overlap_a_little_stay() -> None:
    line = [word("one", 0, 100), word("two", 90, 160), word("-", 155, 170)]
    assert settle_boxes(line) == line


def test_a_box_without_a_free_part_stays() -> None:
    line = [word("whole", 0, 200), word("left", 0, 104), word("right", 98, 199)]
    assert settle_boxes(line) == line


def test_an_unsure_word_at_the_place_of_a_sure_one_is_left_out() -> None:
    sure, again, apart = word("house", 0, 100), word("hause", 20, 110, 0.3), word("dim", 300, 380, 0.3)
    assert settle_boxes([sure, again, apart]) == [sure, apart]
    both = [word("house", 0, 100, 0.4), word("hause", 0, 100, 0.4)]
    assert settle_boxes(both) == both


def test_words_of_one_line_get_common_rows_along_its_slope() -> None:
    def at(x: float, height: float, off: float = 0.0) -> Word:
        middle = 100 + 0.01 * x + off
        return Word("و", (x - 30, middle - height / 2, x + 30, middle + height / 2), 0.9)

    # The third box is of two rows: it says nothing about the line.
    level = with_common_rows([at(100, 40), at(200, 44), at(300, 90, 30), at(400, 40), at(500, 36)])
    for word, x in zip(level, (100, 200, 300, 400, 500), strict=True):
        assert word.box == pytest.approx((x - 30, 80 + 0.01 * x, x + 30, 120 + 0.01 * x), abs=0.1)
    (single,) = with_common_rows([at(100, 40)])
    assert single.box == pytest.approx(at(100, 40).box)


def test_lines_from_right_to_left_have_common_rows() -> None:
    (line,) = rows_of_words([word("שלום", 300, 380), Word("עולם", (100.0, 0.0, 180.0, 90.0), 0.9)])
    assert [each.box[1::2] for each in line.words] == [(0.0, 40.0)] * 2
    (line,) = rows_of_words([word("hello", 100, 180), Word("(world)", (200.0, -5.0, 300.0, 50.0), 0.9)])
    assert line.words[1].box == (200.0, -5.0, 300.0, 50.0)
