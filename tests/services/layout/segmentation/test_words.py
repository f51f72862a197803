"""Words come to the line that holds them; entries of lists join, columns do not."""

import cv2
import numpy as np

from services.arrays import GrayImage
from services.layout.segmentation import segment_page
from services.layout.segmentation.words import assign_words, is_word, line_confidences, words_of_lines
from services.ocr.engine import Word

LINES = np.array([[0.0, 0.0, 300.0, 20.0], [0.0, 30.0, 300.0, 50.0], [400.0, 0.0, 700.0, 20.0]])


def words(*boxes: tuple[float, float, float, float]) -> tuple[list[Word], np.ndarray]:
    listed = [Word(f"w{index}", box, 0.5 + 0.1 * index) for index, box in enumerate(boxes)]
    return listed, np.array([word.box for word in listed]).reshape(-1, 4)


def test_words_come_to_the_line_that_holds_them() -> None:
    listed, boxes = words(
        (150, 2, 200, 18), (10, 2, 90, 18), (10, 28, 90, 52), (500, 2, 560, 18), (800, 2, 900, 18)
    )
    line_of_word = assign_words(listed, boxes, LINES)
    assert line_of_word.tolist() == [0, 0, 1, 2, -1]
    held = words_of_lines(listed, boxes, line_of_word, 3)
    assert [[word.text for word in line] for line in held] == [["w1", "w0"], ["w2"], ["w3"]]
    assert np.allclose(line_confidences(listed, line_of_word, 3), [0.55, 0.7, 0.8])


def test_without_words_or_lines_nothing_is_assigned() -> None:
    listed, boxes = words()
    assert assign_words(listed, boxes, LINES).shape == (0,)
    assert words_of_lines(listed, boxes, assign_words(listed, boxes, LINES), 2) == [[], []]
    listed, boxes = words((0, 0, 10, 10))
    assert assign_words(listed, boxes, np.zeros((0, 4))).tolist() == [-1]


def written(*texts: tuple[int, int, str]) -> GrayImage:
    image = np.full((700, 1200), 255, dtype=np.uint8)
    for x, y, text in texts:
        cv2.putText(image, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.9, 0, 2, cv2.LINE_AA)
    return image


def test_labels_and_their_values_are_one_zone_a_row() -> None:
    rows = (("TO:", "Hannah Whitfield"), ("FROM:", "Peter Longman"), ("DATE:", "12 March 1998"))
    image = written(
        *((100, 150 + 60 * k, label) for k, (label, _) in enumerate(rows)),
        *((260, 150 + 60 * k, value) for k, (_, value) in enumerate(rows)),
    )
    zones = segment_page(image, None).zones
    assert len(zones) == 3
    assert all(zone.box[0] < 110 and zone.box[2] > 440 for zone in zones)


def test_columns_of_names_stay_apart() -> None:
    names = ("Hannah Whitfield", "Institute of Maps", "Rotterdam Harbour")
    image = written(
        *((100, 150 + 34 * k, name) for k, name in enumerate(names)),
        *((600, 150 + 34 * k, name) for k, name in enumerate(reversed(names))),
    )
    zones = segment_page(image, None).zones
    assert [zone.lines for zone in zones] == [3, 3]
    assert zones[0].box[2] < 500 < zones[1].box[0]


TAB = (("TO:", "Hannah Whitfield"), ("FROM:", "Peter Longman"), ("DATE:", "12 March 1998"))


def read(texts: list[tuple[int, int, str]]) -> list[Word]:
    """What a perfect engine reads on the page that `written` draws."""
    found = []
    for x, y, text in texts:
        (width, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.9, 2)
        found.append(Word(text, (x, y - 22.0, x + float(width), y + 2.0), 0.95))
    return found


def rows_of(texts: list[tuple[int, int, str]]) -> list[str]:
    return [zone.text for zone in segment_page(written(*texts), read(texts)).zones]


def test_values_at_a_tab_stop_belong_to_labels_with_colons() -> None:
    texts = [(100, 150 + 60 * k, label) for k, (label, _) in enumerate(TAB)]
    texts += [(400, 150 + 60 * k, value) for k, (_, value) in enumerate(TAB)]
    assert rows_of(texts) == [f"{label} {value}" for label, value in TAB]
    bare = [(x, y, text.rstrip(":")) for x, y, text in texts]
    assert not set(rows_of(bare)).intersection(f"{label.rstrip(':')} {value}" for label, value in TAB)


def test_cells_of_rows_are_no_entries_of_entries() -> None:
    """Each cell but the last was a label, and each but the first a value: the third and fourth were lost."""
    columns = (
        (100, ("12", "24", "18")),
        (225, ("39,00", "69,99", "18,00")),
        (410, ("21%", "21%", "21%")),
        (560, ("39,00", "99,98", "18,00")),
    )
    cells = [(x, 100 + 60 * k, text) for x, texts in columns for k, text in enumerate(texts)]
    prose = [(100, 300 + 32 * k, "Goods stay ours until they have been paid for in full.") for k in range(12)]
    held = [word for row in rows_of([*cells, *prose]) for word in row.split()]
    assert sorted(word for word in held if word[0].isdigit()) == sorted(text for _, _, text in cells)


def test_the_sign_of_a_currency_is_a_word() -> None:
    """It stands before an amount, where it is a word at the end of a line and not between two others."""
    texts = [(100, 150, "Total"), (260, 150, "399,00"), (100, 200, "All of it is due in May")]
    image, listed = written(*texts), read(texts)
    sign = Word("\N{EURO SIGN}", (235.0, 128.0, 252.0, 152.0), 0.95)
    cv2.putText(image, "E", (235, 150), cv2.FONT_HERSHEY_SIMPLEX, 0.9, 0, 2, cv2.LINE_AA)
    rows = [zone.text for zone in segment_page(image, [*listed, sign]).zones]
    assert "\N{EURO SIGN} 399,00" in " ".join(rows)
    assert [is_word(Word(text, sign.box, 0.9)) for text in ("\N{EURO SIGN}", "$", "*", "-")] == [
        True,
        True,
        False,
        False,
    ]


def test_a_value_of_many_lines_belongs_to_a_label_with_a_colon() -> None:
    names = ["Hannah Whitfield", "Ruth Abbot", "Peter Longman", "Olga Lind", "Tom Hardy"]
    texts = [(260, 150 + 34 * k, name) for k, name in enumerate(names)]
    texts += [(100, 150, "TO:"), (100, 350, "FROM:"), (260, 350, "Rose Harris")]
    assert rows_of(texts) == ["\n".join([f"TO: {names[0]}", *names[1:]]), "FROM: Rose Harris"]


def test_an_entry_with_a_near_value_shows_the_list_of_a_lone_label() -> None:
    texts = [
        (100, 150, "TO:"),
        (340, 150, "Hannah Whitfield"),
        (100, 210, "PAGES: 12"),
        (100, 244, "FAX: 555 12"),
    ]
    assert rows_of(texts) == ["TO: Hannah Whitfield", "PAGES: 12", "FAX: 555 12"]
    assert rows_of(texts[:2]) != ["TO: Hannah Whitfield"]


def test_grain_beside_the_paper_does_not_join_two_rows() -> None:
    texts = [
        (300, 300 + 44 * row, text)
        for row, text in enumerate(
            ["Bahnhofstrasse 17", "5722 Winterthur", "Telefon 062 842", "info at shop"]
        )
    ]
    page = written(*texts)
    for place, x in enumerate(range(255, 290, 9)):  # strokes as high as letters, each a little lower
        cv2.line(page, (x, 268 + 14 * place), (x, 296 + 14 * place), 40, 2)
    lines = "\n".join(zone.text for zone in segment_page(page, read(texts)).zones).split("\n")
    for _, _, text in texts:
        assert text in lines
