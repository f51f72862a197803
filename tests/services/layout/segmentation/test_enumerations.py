"""Items of an enumeration begin zones; a number alone, in other brackets or far away begins none."""

from dataclasses import replace

import numpy as np
import pytest

from services.layout.segmentation import segment_page
from services.layout.segmentation.enumerations import item_starts
from services.layout.segmentation.text_lines import Line
from services.ocr.engine import Word
from tests.services.layout.segmentation.test_breaks import blank, put


def lines_of(*texts: str, left: float = 100.0, step: float = 24.0) -> list[Line]:
    return [
        Line(np.arange(9), (left, step * k, 500.0, step * k + 15), step * k + 15.0, 20.0, 10.0, 2.0)
        for k in range(len(texts))
    ]


def starts_of(*texts: str) -> set[int]:
    return item_starts(lines_of(*texts), texts)


def test_items_are_found_by_the_numbers_that_follow_each_other() -> None:
    assert starts_of("(1) an exponential growth", "of everything", "(2) a risk", "(3) errors") == {0, 2, 3}
    assert starts_of("1. first", "2. second", "and more of it") == {0, 1}
    assert starts_of("[9] Smith", "[10] Jones") == {0, 1}
    assert starts_of("a) one", "b) two") == {0, 1}


@pytest.mark.parametrize(
    "texts",
    [
        ("(1) alone", "and nothing else"),
        ("(1) one", "[2] two"),
        ("1. one", "5. five"),
        ("1980 was", "1981 was"),
        ("a. Smith", "b. Jones"),
        ("", ""),
    ],
)
def test_what_is_no_sequence_begins_nothing(texts: tuple[str, ...]) -> None:
    assert starts_of(*texts) == set()


def test_items_have_one_edge_and_one_size_and_go_down() -> None:
    texts = ("(1) one", "(2) two")
    first, second = lines_of(*texts)
    for changed in (
        replace(second, box=(140.0, *second.box[1:])),
        replace(second, em=30.0),
        replace(second, baseline=first.baseline - 30),
    ):
        assert item_starts([first, changed], texts) == set()


def test_each_item_of_a_page_is_a_zone() -> None:
    image, words = blank(), []
    texts = ("(1) exponential growth of all", "(2) a risk of fitting noise", "(3) distances that say less")
    for number, text in enumerate(texts):
        y = 200 + 30 * number
        end = put(image, text, 120, y)
        words.append(Word(text, (120.0, y - 20.0, float(end), y + 4.0), 0.95))
    assert len(segment_page(image, None).zones) == 1
    found = segment_page(image, words).zones
    assert [zone.text for zone in found] == list(texts)
