"""The languages benchmark: places of turned photos, comparison of texts, lines of a page."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.rectify.languages import normalise, turned_back
from simulation.language_pages import find_typeface, set_language_page
from simulation.language_texts import TEXTS


@pytest.mark.parametrize("turns", range(4))
def test_places_of_a_turned_photo_are_found_in_the_photo(turns: int) -> None:
    photo = np.arange(35).reshape(5, 7)
    turned = np.rot90(photo, turns)
    rows, columns = np.indices(turned.shape).reshape(2, -1)
    x, y = turned_back(np.column_stack([columns, rows]).astype(np.float64), turns, (7, 5)).astype(int).T
    assert np.array_equal(photo[y, x], turned[rows, columns])


def test_texts_are_compared_without_spaces_in_one_form_of_unicode() -> None:
    assert normalise(" 水 は\n") == normalise("水は")
    assert normalise("e\u0301te\u0301") == normalise("été")


def test_there_are_ten_languages_of_four_scripts_and_more() -> None:
    assert len({text.name for text in TEXTS}) == 10
    assert len({text.script for text in TEXTS}) >= 4


def test_lines_are_printed_in_their_order() -> None:
    typeface = find_typeface("Latin")
    if typeface is None:
        pytest.skip("no typeface of Debian's fonts-dejavu-core")
    page = set_language_page(TEXTS[0], typeface, 600, 800, 18)
    assert page.lines[0][0].text == TEXTS[0].heading
    tops = [line[0].box[1] for line in page.lines]
    assert tops == sorted(tops)
    for (word,) in page.lines:
        x0, y0, x1, y1 = (round(edge + 0.5) for edge in word.box)
        assert page.image[y0:y1, x0:x1].min() < 64
    ink = np.count_nonzero(page.image < 128)
    boxes = sum(
        np.count_nonzero(
            page.image[round(b[1] + 0.5) : round(b[3] + 0.5), round(b[0] + 0.5) : round(b[2] + 0.5)] < 128
        )
        for b in (line[0].box for line in page.lines)
    )
    assert boxes >= 0.99 * ink


def test_a_missing_typeface_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("simulation.language_pages.FONT_FOLDERS", (tmp_path,))
    assert find_typeface("Latin") is None
    (tmp_path / "DejaVuSans.ttf").touch()
    assert find_typeface("Latin") == tmp_path / "DejaVuSans.ttf"
