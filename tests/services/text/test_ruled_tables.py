"""Tables with a grid are read row by row, a cell with several lines as a whole."""

from services.ocr.engine import Word
from services.text.ruled_tables import read_tables
from tests.services.text.pages import word

CELLS = [(0, 0, 200, 60), (200, 1, 400, 60), (0, 60, 200, 200), (200, 60, 400, 199)]
"""Two rows of two cells."""


def lines(words: list[Word]) -> list[str]:
    blocks = read_tables(words, [CELLS]).blocks
    return [line.text for block in blocks for line in block.lines]


def test_a_row_of_single_lines_is_one_line_even_if_they_are_not_level() -> None:
    assert lines([word("right", 220, 25), word("left", 20, 8)]) == ["left right"]


def test_a_cell_of_several_lines_is_read_as_a_whole() -> None:
    # The engine took the upper lines of both cells for one.
    words = [
        word("item", 20, 90, line=1),
        word("first", 220, 70, line=1),
        word("second", 220, 110, line=2),
        word("name", 20, 20, line=0),
        word("value", 220, 20, line=0),
    ]
    assert lines(words) == ["name value", "item", "first", "second"]


def test_columns_without_rules_between_their_rows_are_read_across() -> None:
    rows = [(f"{row}.50", f"item{row}", f"town{row}") for row in range(3)]
    cells = [(0, 0, 150, 200), (150, 0, 300, 200), (300, 0, 450, 200)]
    words = [
        word(text, x, 20 + 40 * k)
        for k, row in enumerate(rows)
        for text, x in zip(row, (20, 170, 320), strict=True)
    ]
    (block,) = read_tables(words, [cells]).blocks
    assert [line.text for line in block.lines] == ["0.50 item0 town0", "1.50 item1 town1", "2.50 item2 town2"]


def test_two_addresses_beside_each_other_are_read_one_by_one() -> None:
    sides = [("from", "street", "town"), ("to", "road", "city")]
    words = [
        word(text, x, 70 + 40 * k)
        for side, x in zip(sides, (20, 220), strict=True)
        for k, text in enumerate(side)
    ]
    assert lines(words) == ["from", "street", "town", "to", "road", "city"]


def test_a_cell_may_go_on_below_its_row() -> None:
    words = [word("design", 20, 70), word("12.50", 220, 72), word("of", 20, 110), word("pages", 110, 110)]
    assert lines(words) == ["design 12.50", "of pages"]


def test_cells_of_hebrew_begin_at_the_right() -> None:
    words = [word("שם", 220, 90), word("ראשון", 20, 70), word("שני", 20, 110)]
    assert lines(words) == ["שם", "ראשון", "שני"]


def test_words_outside_of_the_cells_stay() -> None:
    outside, left, right = word("outside", 20, 300), word("left", 20, 20), word("right", 220, 20)
    found = read_tables([outside, left, right], [CELLS])
    assert found.others == (outside,)
    assert [line.words for block in found.blocks for line in block.lines] == [(left, right)]


def test_a_frame_is_no_table() -> None:
    words = [word("left", 20, 20), word("below", 20, 70)]
    found = read_tables(words, [CELLS])
    assert found.blocks == ()
    assert found.others == tuple(words)


def test_a_rule_through_words_is_no_rule_of_a_table() -> None:
    prose = [word("through", 160, 10 + 40 * k) for k in range(2)] + [
        word("beside", 20, 10),
        word("after", 300, 10),
    ]
    assert read_tables(prose, [CELLS]).blocks == ()
