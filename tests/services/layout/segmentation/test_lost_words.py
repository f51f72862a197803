"""Words without a line: many become lines, a few do not."""

from dataclasses import replace

import numpy as np

from services.layout.segmentation import compose_page
from services.layout.segmentation.fine_page import FinePage
from services.layout.segmentation.frame import LevelledFrame
from services.layout.segmentation.lost_words import with_lost_words
from services.layout.segmentation.text_lines import Line
from services.ocr.engine import Word

FRAME = LevelledFrame((1.0, 1.0), 0.0, (400, 400))
HELD = tuple(
    Word(text, (20.0 + 60 * k, 20.0, 70.0 + 60 * k, 34.0), 0.9) for k, text in enumerate(("one", "two"))
)
LOST = [
    Word(text, (left, top, left + 50.0, top + 14.0), 0.9)
    for text, left, top in (
        ("Date", 20.0, 60.0),
        ("13-02-2016", 76.0, 61.0),
        ("02:29", 250.0, 60.0),
        ("Total", 20.0, 90.0),
        ("96.20", 76.0, 90.0),
    )
]


def fine_page() -> FinePage:
    """A line with its words, and a scrap without any where the lost ones stand."""
    line = Line(np.arange(4), (20.0, 20.0, 130.0, 34.0), 34.0, 20.0, 9.0, 2.0)
    scrap = Line(np.arange(4, 6), (22.0, 62.0, 40.0, 72.0), 72.0, 14.0, 8.0, 2.0)
    return FinePage(
        400.0,
        400.0,
        1.0,
        (line, scrap),
        np.array([line.box, scrap.box]),
        ("one two", ""),
        (HELD, ()),
        frozenset(),
        ((0,), (1,)),
        (),
    )


def test_many_lost_words_become_lines_by_rows_and_columns() -> None:
    found = with_lost_words(fine_page(), [*HELD, *LOST], FRAME)
    zones = {zone.text: zone for zone in compose_page(found).zones}
    assert zones.keys() == {"one two", "Date 13-02-2016", "02:29", "Total 96.20"}, "and the scrap is gone"
    total = zones["Total 96.20"]
    assert total.box == (20.0, 90.0, 126.0, 104.0)
    assert [word.text for word in total.words] == ["Total", "96.20"]


def test_a_page_whose_words_have_lines_stays() -> None:
    page = fine_page()
    few = [replace(word, confidence=0.8) for word in LOST[:4]]
    assert with_lost_words(page, [*HELD, *few], FRAME) is page, "fewer than five, and no sure values"
    assert with_lost_words(page, None, FRAME) is page
    unsure = [replace(word, confidence=0.5) for word in LOST]
    assert with_lost_words(page, [*HELD, *unsure], FRAME) is page
    many = [replace(word, text=f"{word.text}{k}") for k in range(30) for word in HELD]
    held = replace(page, words=(tuple(many), ()))
    plain = [replace(word, text="word") for word in LOST]
    assert with_lost_words(held, [*many, *plain], FRAME) is held, "a twelfth of the words"


def test_words_of_a_turned_copy_lie_on_it() -> None:
    frame = LevelledFrame((2.0, 2.0), 0.02, (200, 200))
    found = with_lost_words(fine_page(), [*HELD, *LOST], frame)
    line = found.lines[-1]
    middle = frame.level(found.boxes[-1:] / 2)[0]
    np.testing.assert_allclose(line.box, middle)
    assert line.baseline == line.box[3]


def test_a_sure_value_without_a_line_becomes_one_though_it_is_alone() -> None:
    found = with_lost_words(fine_page(), [*HELD, LOST[0], LOST[1]], FRAME)
    assert {zone.text for zone in compose_page(found).zones} >= {"one two", "13-02-2016"}
    assert "Date" not in " ".join(zone.text for zone in compose_page(found).zones), "a word may be a scrap"
