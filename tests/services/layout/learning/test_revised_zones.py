"""What zones that a person drew have of the found zones under them."""

from services.layout.learning.revised_zones import revise_zones
from services.layout.page import Page, Zone, ZoneWord


def word(text: str, x0: float, x1: float, line: int = 0) -> ZoneWord:
    return ZoneWord(text, (x0, 20.0 * line + 2, x1, 20.0 * line + 16), 0.9, line)


ROW = Zone(
    "z1",
    (10.0, 0.0, 200.0, 40.0),
    lines=2,
    font_size=14.0,
    text="Total Payable: 54.15\nCash 60.00",
    words=(
        word("Total", 10, 50),
        word("Payable:", 54, 110),
        word("54.15", 160, 200),
        word("Cash", 10, 40, 1),
        word("60.00", 160, 200, 1),
    ),
)
BORDER = Zone("z2", (0.0, 0.0, 300.0, 300.0), kind="noise")
PAGE = Page(300.0, 300.0, (ROW, BORDER))


def revised(*zones: Zone) -> tuple[Zone, ...]:
    return revise_zones(PAGE, Page(300.0, 300.0, zones)).zones


def test_a_value_drawn_in_a_line_has_its_words() -> None:
    value, column = revised(
        Zone("a", (155.0, 0.0, 205.0, 20.0), label="total"), Zone("b", (150.0, 0.0, 210.0, 40.0))
    )
    assert (value.text, value.kind, value.lines, value.label) == ("54.15", "text", 1, "total")
    assert [each.box for each in value.words] == [ROW.words[2].box]
    assert value.font_size == ROW.font_size, "a border that lies under it has none"
    assert (column.text, column.lines) == ("54.15\n60.00", 2)
    assert [each.line for each in column.words] == [0, 1]


def test_what_a_person_gives_counts_more_and_one_place_is_one_zone() -> None:
    typed, same, empty = revised(
        Zone("a", (155.0, 0.0, 205.0, 20.0), text="54.16"),
        Zone("b", ROW.box, label="all"),
        Zone("c", (220.0, 200.0, 260.0, 240.0)),
    )
    assert (typed.text, typed.words) == ("54.16", ())
    assert (same.text, same.words, same.label) == (ROW.text, ROW.words, "all")
    assert (empty.text, empty.kind) == ("", "noise"), "what lies in the border alone is like it"


def test_lines_of_zones_without_words_are_taken_by_their_height() -> None:
    plain = Page(300.0, 300.0, (Zone("z", (0.0, 0.0, 100.0, 60.0), lines=3, text="one\ntwo\nthree"),))
    drawn = Page(300.0, 300.0, (Zone("a", (0.0, 18.0, 100.0, 42.0)),))
    assert revise_zones(plain, drawn).zones[0].text == "two"
