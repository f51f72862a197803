"""An image that does not read as it lies is turned, and the answer says so: a scripted engine proves the logic."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from services.arrays import GrayImage, RgbImage
from services.contract.rectify import PrintedWord, TypesetPage
from services.ocr.engine import Word
from services.operations.page_reading import LIMIT_S, READING_CUT
from services.operations.upright_reading import UprightReading, read_as_it_lies, read_upright
from services.rectify.results import Orientation
from tests.services.ocr.pages import blank, set_lines
from tests.services.ocr.test_lost_lines import LineEngine
from tests.services.rectify.view.test_orientation import FlagReader, laid, page_of_flags

pytestmark = pytest.mark.pipeline

HIGH, WIDE = (0.0, 0.0, 20.0, 80.0), (0.0, 0.0, 80.0, 20.0)


@dataclass
class PageReader(FlagReader):
    """Reads pages too: words of `box` and `confidence`, better once the first page has been turned."""

    confidence: float = 0.9
    box: tuple[float, float, float, float] = WIDE
    pages: list[GrayImage] = field(default_factory=list)

    def read_page(self, image: GrayImage) -> list[Word]:
        self.pages.append(image)
        again = len(self.pages) > 1
        return [Word("words", WIDE if again else self.box, 0.95 if again else self.confidence)]


def lying(turn: int) -> RgbImage:
    return np.repeat(laid(page_of_flags(), Orientation(turn, False, None))[..., None], 3, axis=2)


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
def test_a_page_that_is_set_in_type_is_turned_as_its_file_says(turn: int) -> None:
    """Its words are those of the file: "top" lies at the top left of the upright page, in a corner of the image."""
    image = lying(turn)
    corner = {0: (0.1, 0.1), 90: (0.1, 0.8), 180: (0.8, 0.8), 270: (0.8, 0.1)}[turn]
    word = PrintedWord("top", (*corner, corner[0] + 0.1, corner[1] + 0.1), 3)
    engine = PageReader()
    engine.read_line = lambda image: ("", 0.0)  # type: ignore[method-assign]
    found = read_upright(image, engine, TypesetPage(turn, (word,), has_pictures=False))  # type: ignore[arg-type]
    np.testing.assert_array_equal(found.image, lying(0))
    height, width = found.image.shape[:2]
    assert found.words is not None
    assert engine.pages == []
    assert [(each.text, each.line) for each in found.words] == [("top", 3)]
    shares = np.array(found.words[0].box) / (width, height, width, height)
    np.testing.assert_allclose(shares, (0.1, 0.1, 0.2, 0.2), atol=0.002)
    assert found.orientation == Orientation(turn, False, None)
    assert [notice.code for notice in found.notices] == ["page-turned"] * (turn != 0)


@pytest.mark.parametrize("turn", [90, 180, 270])
def test_an_image_that_reads_badly_is_turned_and_read_again(turn: int) -> None:
    engine = PageReader(confidence=0.2)
    found = read_upright(lying(turn), engine)
    assert found.orientation is not None
    assert (found.orientation.rotation_deg, found.orientation.mirrored) == (turn, False)
    np.testing.assert_array_equal(found.image, lying(0))
    assert [notice.code for notice in found.notices] == ["page-turned"]
    assert len(engine.pages) == 2
    assert found.words is not None
    assert found.words[0].confidence == 0.95


def test_words_that_run_up_the_page_are_not_believed() -> None:
    found = read_upright(lying(90), PageReader(box=HIGH))
    assert found.orientation is not None
    assert found.orientation.rotation_deg == 90


def test_a_page_that_reads_well_is_read_once() -> None:
    engine = PageReader()
    found = read_upright(lying(180), engine)
    assert (len(engine.pages), engine.reads) == (1, 0)
    assert found.orientation == Orientation(0, False, 0.9)
    assert found.notices == ()


def test_an_upright_page_of_an_unknown_language_stays() -> None:
    engine = PageReader(confidence=0.2)
    found = read_upright(lying(0), engine)
    np.testing.assert_array_equal(found.image, lying(0))
    assert (len(engine.pages), found.notices) == (2, ()), "it is read softer, but not turned"


class CutReader(PageReader):
    """It has read one word when the time is over."""

    def read_page_within(self, image: GrayImage, seconds: float) -> tuple[list[Word], bool]:
        assert seconds == LIMIT_S
        return self.read_page(image), True


@pytest.mark.parametrize("read", [read_upright, read_as_it_lies])
def test_a_page_that_is_not_read_to_its_end_says_so(read: Callable[..., UprightReading]) -> None:
    engine = CutReader(confidence=0.9)
    found = read(lying(0), engine)
    assert [word.text for word in found.words or ()] == ["words"]
    assert (found.notices, len(engine.pages)) == ((READING_CUT,), 1)


class LossyReader(LineEngine):
    """Its page layout finds the first and the last of three lines."""

    def __init__(self, boxes: list[tuple[int, int, int, int]]) -> None:
        super().__init__()
        self.boxes = boxes

    def read_page(self, image: GrayImage) -> list[Word]:
        return [Word("a line that reads well", tuple(map(float, self.boxes[k])), 0.9) for k in (0, 2)]  # type: ignore[arg-type]


@pytest.mark.parametrize("read", [read_upright, read_as_it_lies])
def test_lines_that_the_page_layout_lost_are_read(read: Callable[..., UprightReading]) -> None:
    """As /rectify reads a page: rows of an invoice on a tint had zones without a text."""
    canvas = blank(1000, 360)
    boxes = set_lines(canvas, (60, 60), 3, 36, words=6)
    image = np.repeat(np.asarray(canvas, dtype=np.uint8)[..., None], 3, axis=2)
    found = read(image, LossyReader(boxes))
    assert [word.text for word in found.words or ()].count("read again") == 1


def test_without_an_engine_nothing_is_known() -> None:
    for read in (read_upright, read_as_it_lies):
        found = read(lying(180), None)
        assert (found.words, found.orientation, found.notices) == (None, None, ())
