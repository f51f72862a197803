"""Words and zones right: marks within true zones, the smallest zone that holds each, labels compared."""

import numpy as np

from benchmarks.layout.marks import count_right, count_zones_right, ink_marks, word_marks, zone_of_points
from services.layout.page import Page, Zone
from services.ocr.engine import Word

OUTER = Zone("o", (0.0, 0.0, 100.0, 100.0), label="figure")
INNER = Zone("i", (10.0, 10.0, 40.0, 30.0), label="caption")
TRUTH = Page(200.0, 200.0, (OUTER, INNER))


def word(text: str, x: float, y: float) -> Word:
    return Word(text, (x - 4, y - 2, x + 4, y + 2), 0.9)


def test_a_point_belongs_to_the_smallest_zone_that_holds_it() -> None:
    points = np.array([[20.0, 20.0], [80.0, 80.0], [150.0, 150.0]])
    assert zone_of_points(points, TRUTH.zones).tolist() == [1, 0, -1]
    assert zone_of_points(points, ()).tolist() == [-1, -1, -1]


def test_words_outside_true_zones_and_words_without_letters_do_not_count() -> None:
    words = [word("in", 20, 20), word("out", 80, 80), word("far", 150, 150), word("--", 20, 20)]
    assert word_marks(words, TRUTH).labels == ("caption", "figure")


def test_a_word_is_right_in_a_zone_of_its_label() -> None:
    marks = word_marks([word("in", 20, 20), word("out", 80, 80)], TRUTH)
    assert count_right(marks, TRUTH) == (2, 2)
    assert count_right(marks, Page(200.0, 200.0, (OUTER,))) == (1, 2)
    assert count_right(marks, Page(200.0, 200.0, ())) == (0, 2)


def test_ink_is_counted_where_it_lies() -> None:
    gray = np.full((200, 200), 255, dtype=np.uint8)
    gray[15:25, 15:35] = 0
    gray[150:160, 150:170] = 0
    marks = ink_marks(gray, TRUTH)
    assert set(marks.labels) == {"caption"}
    assert 150 < len(marks.labels) <= 600


def test_zones_need_their_place_and_their_label() -> None:
    near = Zone("n", (12.0, 10.0, 42.0, 30.0), label="caption")
    assert count_zones_right(TRUTH, Page(200.0, 200.0, (near, OUTER))) == (2, 2)
    assert count_zones_right(TRUTH, Page(200.0, 200.0, (Zone("n", near.box, label="body"),))) == (0, 2)
    assert count_zones_right(
        TRUTH, Page(200.0, 200.0, (Zone("f", (20.0, 10.0, 60.0, 30.0), label="caption"),))
    ) == (0, 2)
    assert count_zones_right(TRUTH, Page(200.0, 200.0, ())) == (0, 2)
