"""Words -> blocks in reading order; places of words in the photo."""

import numpy as np
import pytest

from services.ocr.engine import Word
from services.text.arrangement import Region, arrange_words, rows_of
from services.text.page_text import is_right_to_left, join_words
from services.text.photo_places import locate_boxes, locate_points
from tests.services.text.pages import rows_of_words, word


def texts(blocks: object) -> list[list[str]]:
    """Text of every line of every block."""
    return [[line.text for line in block.lines] for block in blocks]  # type: ignore[attr-defined]


def test_words_follow_the_regions_and_none_is_lost() -> None:
    left = [word("one", 0, 0), word("two", 100, 2), word("three", 0, 50)]
    right = [word("four", 500, 0), word("five", 600, -2)]
    stray = [word("six", 0, 900), word("—", 300, 900)]
    engine_order = [left[0], right[0], left[1], right[1], left[2], *stray]
    regions = [
        Region((-10, -10, 200, 100), 30.0, (left[0].box, left[1].box)),
        Region((490, -10, 700, 60), 30.0, ()),
    ]
    blocks = arrange_words(engine_order, regions)
    # The stray dash is of no region, and no word.
    assert texts(blocks) == [["one two", "three"], ["four five"], ["six"]]


def test_large_short_print_is_a_heading() -> None:
    body = [word(f"w{index}", 100 * index, 200) for index in range(8)]
    title = word("Report", 0, 0, 300, 80)
    section = word("Section", 0, 120, 100, 40)
    regions = [
        Region(title.box, 70.0, ()),
        Region(section.box, 40.0, ()),
        Region((0, 190, 900, 240), 30.0, ()),
    ]
    blocks = arrange_words([*body, title, section], regions)
    assert [(block.kind, block.level) for block in blocks] == [("heading", 1), ("heading", 2), ("text", 0)]


def test_a_row_is_read_in_the_direction_of_its_script() -> None:
    (line,) = rows_of_words([word("שלום", 300, 0), word("עולם", 100, 3)])
    assert line.text == "שלום עולם"
    assert line.right_to_left
    (line,) = rows_of_words([word("world", 300, 0), word("hello", 100, 3)])
    assert line.text == "hello world"


def test_a_comma_of_its_own_stays_in_its_row() -> None:
    (line,) = rows_of_words([word("now", 0, 0), word(",", 90, 22, 6, 12), word("then", 100, 0)])
    assert line.text == "now , then"


def test_scripts_and_spaces() -> None:
    assert join_words(["日本", "語", "is", "日"]) == "日本語 is 日"
    assert join_words([]) == ""
    assert is_right_to_left("مرحبا 12")
    assert not is_right_to_left("12 %")


def test_places_follow_the_mesh() -> None:
    """Analytic case: an affine map is exact between the nodes."""
    width, height, rows, columns = 401, 301, 7, 9
    x, y = np.meshgrid(np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows))
    affine = np.array([[1.5, 0.2, 10.0], [-0.1, 2.0, 5.0]])

    def photo(points: np.ndarray) -> np.ndarray:
        return np.asarray(points @ affine[:, :2].T + affine[:, 2])

    mesh = photo(np.stack([x, y], axis=-1))
    points = np.random.default_rng(3).uniform([0, 0], [width - 1, height - 1], (50, 2))
    assert locate_points(mesh, width, height, points) == pytest.approx(photo(points))
    (quad,) = locate_boxes(mesh, width, height, [(10.5, 20.5, 60.5, 40.5)])
    assert np.array(quad) == pytest.approx(
        photo(np.array([[10, 20], [60, 20], [60, 40], [10, 40]])), abs=0.01
    )


def test_a_word_outside_of_the_photo_has_no_place() -> None:
    mesh = np.array([[[0.0, 0], [9, 0]], [[0, 9], [np.nan, np.nan]]])
    assert locate_boxes(mesh, 10, 10, [(2, 2, 5, 5)]) == (None,)
    assert locate_boxes(mesh, 10, 10, []) == ()


def test_a_row_that_was_made_up_is_left_out_but_for_its_sure_words() -> None:
    """The grain of a desk is read as a row of letters, some of them with some confidence."""
    body = Word("body", (100, 100, 180, 120), 0.95)
    grain = [Word("ppppqpppppqp", (100, 300, 300, 320), 0.05), Word("p", (310, 300, 316, 320), 0.6)]
    number = Word("17", (700, 300, 730, 320), 0.9)
    alone = Word("foot", (100, 400, 150, 420), 0.45)
    regions = [Region((90, 90, 200, 130), 20.0, (body.box,))]
    assert texts(arrange_words([body, *grain, number, alone], regions)) == [["body"], ["17"], ["foot"]]


def numbered(text: str, line: int, x: float, y: float) -> Word:
    """A word of one of the engine's lines, 80 x 40 px."""
    return Word(text, (x, y, x + 80, y + 40), 0.9, line)


def test_a_line_that_zones_cut_stays_a_line() -> None:
    """It rises by more than its height; each zone holds the words of three lines that are level with it."""
    lines = [[numbered(f"{row}{k}", row, 100 * k, 60 * row - 8 * k) for k in range(8)] for row in range(6)]
    regions = [
        Region(
            (0, top - 60, 800, top + 120), 30.0, tuple(w.box for w in words if top <= w.box[1] < top + 180)
        )
        for top in (-60, 120)
        for words in [[word for line in lines for word in line]]
    ]
    blocks = arrange_words([word for line in lines for word in line], regions)
    wanted = [" ".join(f"{row}{k}" for k in range(8)) for row in range(6)]
    assert [line for block in texts(blocks) for line in block] == wanted


def test_parts_of_a_row_are_one_line_and_lines_above_each_other_are_two() -> None:
    """The engine took label and amount for two columns; a third line lies a little lower than the first."""
    words = [numbered("Total", 0, 0, 0), numbered("4.25", 1, 600, 3), numbered("Cash", 2, 10, 22)]
    region = Region((0, 0, 700, 70), 30.0, tuple(word.box for word in words))
    assert texts(arrange_words(words, [region])) == [["Total 4.25", "Cash"]]


def test_a_line_without_a_zone_comes_after_what_lies_above_it() -> None:
    words = [numbered("head", 0, 0, 0), numbered("foot", 1, 0, 300), numbered("loose", 2, 0, 100)]
    regions = [Region(word.box, 30.0, (word.box,)) for word in words[:2]]
    assert texts(arrange_words(words, regions)) == [["head"], ["loose"], ["foot"]]


def _table(*rows: tuple[str, int, str, int]) -> list[Word]:
    """Entries at the left and values at `x`, each a line of the engine."""
    words = []
    for number, (entry, y, value, x) in enumerate(rows):
        words += [word(text, 100 * k, y, line=2 * number) for k, text in enumerate(entry.split())]
        words += [word(text, x + 100 * k, y + 2, line=2 * number + 1) for k, text in enumerate(value.split())]
    return words


def test_a_row_with_an_amount_is_where_its_words_are() -> None:
    words = [word("Bar", 0, 0, line=0), word("1.165,40", 700, 0, line=0), word("Danke", 0, 100, line=1)]
    regions = [Region((-10, -10, 100, 140), 30.0, ()), Region((690, -10, 800, 40), 30.0, ())]
    assert texts(arrange_words(words, regions)) == [["Bar 1.165,40", "Danke"]]


def test_values_of_a_column_are_read_by_rows() -> None:
    rows = [("Beeswax XL", 0, "1.00 42.00 EUR", 700), ("Office chair", 100, "2.00 70.00 EUR", 700)]
    words = [
        *_table(*rows),
        *[word(text, 100 * k, 50, line=9) for k, text in enumerate(["made", "of", "wax"])],
    ]
    regions = [Region((-10, -10, 600, 150), 30.0, ()), Region((690, -10, 1100, 150), 30.0, ())]
    assert texts(arrange_words(words, regions)) == [
        ["Beeswax XL 1.00 42.00 EUR", "made of wax", "Office chair 2.00 70.00 EUR"]
    ]


@pytest.mark.parametrize(
    ("head", "at", "is_head"),
    [
        ("Quantity", -50, True),
        ("Quantity", -150, False),  # far above
        ("Total 12", -50, False),  # a value of its own
        ("Quantity", 150, False),  # below
    ],
)
def test_heads_of_columns_stand_above_their_values(head: str, at: int, is_head: bool) -> None:
    """Segmentation has the heads, and the address below the table, as later regions."""
    rows = [("Beeswax XL", 0, "1.00 42.00", 700), ("Office chair", 100, "2.00 70.00", 700)]
    words = [word("Mitchell", 0, 300, line=8), *_table(*rows), word(head, 700, at, line=9)]
    regions = [Region((-10, -10, 1100, 150), 30.0, ()), Region((-10, 290, 600, 330), 30.0, ())]
    regions.append(Region((690, at - 10, 1300, at + 40), 30.0, (words[-1].box,)))
    table = ["Beeswax XL 1.00 42.00", "Office chair 2.00 70.00"]
    found = [[head, *table], ["Mitchell"]] if is_head else [table, ["Mitchell"], [head]]
    assert texts(arrange_words(words, regions)) == found


def test_a_value_in_the_gap_of_a_row_is_of_that_row() -> None:
    words = [word("Kart", 0, 0, line=0), word("21%", 500, 0, line=1), word("44,99", 700, 1, line=1)]
    words += [word("1", 300, 2, 20, line=2), word("€44", 360, 2, 80, line=2)]
    (line,) = rows_of([words[:1], words[1:3], words[3:]])
    assert line.text == "Kart 1 €44 21% 44,99"


def test_values_beside_prose_are_of_another_column() -> None:
    prose = " ".join(f"w{index}" for index in range(8))
    rows = [(prose, 60 * k, f"{k}.00 {k}.50", 1000) for k in range(4)]
    regions = [Region((-10, -10, 900, 300), 30.0, ()), Region((990, -10, 1300, 300), 30.0, ())]
    found = texts(arrange_words(_table(*rows), regions))
    assert found == [[prose] * 4, [f"{k}.00 {k}.50" for k in range(4)]]
