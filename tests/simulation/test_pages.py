"""Set pages hold the words that they say, where they say."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from simulation.flat_page import Page
from simulation.pages import Block, Setting, load_page, own_pages, set_page


@pytest.fixture(scope="module")
def pages() -> tuple[Page, ...]:
    return own_pages(800, 1250)


def test_five_pages_of_much_text(pages: tuple[Page, ...]) -> None:
    assert len({page.name for page in pages}) == 5
    for page in pages:
        assert (page.width, page.height) == (800, 1250)
        assert sum(map(len, page.lines)) > 250


def test_every_word_box_holds_ink_and_no_ink_is_outside(pages: tuple[Page, ...]) -> None:
    page = pages[0]
    rest = page.image.copy()
    for line in page.lines:
        for word in line:
            x0, y0, x1, y1 = (round(value + 0.5) for value in word.box)
            assert page.image[y0:y1, x0:x1].min() < 128, word.text
            rest[y0:y1, x0:x1] = 255
    assert (rest < 128).mean() < 1e-4


def test_lines_are_justified_and_apart(pages: tuple[Page, ...]) -> None:
    lines = [line for line in pages[0].lines if len(line) > 5]
    ends = np.array([line[-1].box[2] for line in lines])
    assert np.mean(ends > ends.max() - 5) > 0.5
    for above, below in zip(pages[0].lines, pages[0].lines[1:], strict=False):
        assert max(word.box[3] for word in above) < max(word.box[3] for word in below)


def test_two_columns_do_not_touch(pages: tuple[Page, ...]) -> None:
    spans = np.array([(line[0].box[0], line[-1].box[2]) for line in pages[4].lines])
    left = spans[:, 0] < 300
    assert 0.2 < left.mean() < 0.8
    assert spans[left, 1].max() + 10 < spans[~left, 0].min()


def test_a_picture_is_no_text(pages: tuple[Page, ...]) -> None:
    assert np.mean((pages[2].image > 40) & (pages[2].image < 215)) > 0.03
    assert np.mean((pages[0].image > 40) & (pages[0].image < 215)) < 0.06


def test_what_does_not_fit_is_left_away() -> None:
    page = set_page((Block("paragraph", "word " * 400),), Setting(300, 200, 20))
    assert 0 < sum(map(len, page.lines)) < 400
    assert max(word.box[3] for line in page.lines for word in line) < 200


def test_load_page_scales_words_with_the_pixels(tmp_path: Path) -> None:
    image = np.full((300, 200), 255, np.uint8)
    image[100:120, 40:90] = 0
    image[250:270, 40:90] = 0
    cv2.imwrite(str(tmp_path / "leaf.png"), image)
    words = [[["one", 39.5, 99.5, 89.5, 119.5]], [["two", 39.5, 249.5, 89.5, 269.5]]]
    (tmp_path / "leaf.json").write_text(json.dumps({"dpi": 300, "lines": words}))
    page = load_page(tmp_path / "leaf.png", 400, 400)
    assert page.image.shape == (400, 400)
    assert page.dpi == 600
    # The second line would lie below the cut: it is neither shown nor told.
    assert [word.text for line in page.lines for word in line] == ["one"]
    assert page.lines[0][0].box == (79.5, 199.5, 179.5, 239.5)
    assert page.image[200:239, 80:179].max() < 128
    assert page.image[245:].min() > 240
    longer = load_page(tmp_path / "leaf.png", 200, 350)
    assert len(longer.lines) == 2
    assert longer.image[300:].min() == 255


def test_a_page_is_uint8() -> None:
    with pytest.raises(ValueError, match="uint8"):
        Page(np.zeros((10, 10), np.float64))  # type: ignore[arg-type]
