"""Words find their zones: the smallest that holds their centre, line by line."""

from dataclasses import replace

from services.layout.content.zone_texts import fill_texts
from services.layout.page import Page, Zone
from services.ocr.engine import Word


def word(text: str, x: float, y: float, width: float = 40.0) -> Word:
    return Word(text, (x, y, x + width, y + 10.0), 0.9)


OUTER = Zone("outer", (0, 0, 500, 500))
INNER = Zone("inner", (100, 100, 300, 200))
PAGE = Page(500, 500, (OUTER, INNER))


def test_words_belong_to_the_smallest_zone_around_their_centre() -> None:
    words = [word("top", 10, 10), word("in", 120, 120), word("edge", 290, 150), word("away", 600, 10)]
    filled = fill_texts(PAGE, words)
    assert [zone.text for zone in filled.zones] == ["top\nedge", "in"]


def test_a_word_on_the_edge_is_inside() -> None:
    assert fill_texts(PAGE, [word("on", 80, 95)]).zones[1].text == "on"


def test_lines_begin_where_words_go_back_and_down() -> None:
    words = [word("one", 110, 110), word("two", 160, 108), word("three", 110, 130), word("four", 170, 131)]
    assert fill_texts(PAGE, words).zones[1].text == "one two\nthree four"
    raised = [word("x", 110, 110), word("2", 105, 104)]
    assert fill_texts(PAGE, raised).zones[1].text == "x 2", "back but not lower is the same line"


def test_a_line_that_is_set_further_right_is_a_line() -> None:
    words = [word("cc:", 110, 110), word("Mr", 160, 130), word("Smith", 210, 130)]
    assert fill_texts(PAGE, words).zones[1].text == "cc:\nMr Smith"
    lowered = [word("H", 110, 110), word("2", 151, 115), word("O", 192, 110)]
    assert fill_texts(PAGE, lowered).zones[1].text == "H 2 O"


def test_texts_that_are_known_are_kept() -> None:
    known = replace(PAGE, zones=(OUTER, replace(INNER, text="told")))
    assert fill_texts(known, [word("read", 120, 120)]).zones[1].text == "told"


def test_nothing_to_do() -> None:
    assert fill_texts(PAGE, []) is PAGE
    empty = Page(10, 10, ())
    assert fill_texts(empty, [word("a", 1, 1)]) is empty
    assert [zone.text for zone in fill_texts(PAGE, [word("off", 900, 900)]).zones] == ["", ""]
