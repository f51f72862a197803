"""Boxes of one line's words: none spans another, no word is there twice."""

from services.ocr.engine import Word
from services.text.arrangement import rows_of
from services.text.word_boxes import settle_boxes


def word(text: str, x0: float, x1: float, confidence: float = 0.9) -> Word:
    return Word(text, (x0, 0.0, x1, 40.0), confidence)


def test_a_box_that_spans_its_neighbours_keeps_its_widest_free_part() -> None:
    # Printed from right to left; the box of the fourth word begins at that of the second.
    first, second, third = word("في", 470, 494), word("طريقه", 388, 453), word("إلى", 340, 376)
    spanning = word("البحر", 254, 454)
    settled = settle_boxes([spanning, first, second, third])
    assert settled == [word("البحر", 254, 340), first, second, third]
    (line,) = rows_of([first, spanning, second, third])
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
