"""Upright by reading: a scripted engine proves the logic, a real one (where installed) the recipe."""

import importlib.util
from dataclasses import dataclass, field

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import ImageDraw, ImageFont

from services.arrays import GrayImage
from services.ocr.engine import ReadDirection, Word
from services.ocr.tesseract import find_tessdata, open_engine
from services.rectify.results import Orientation
from services.rectify.view.orientation import estimate_orientation
from services.rectify.view.turned_image import apply_orientation
from tests.counts import some
from tests.services.ocr.pages import blank, set_lines, text_page

pytestmark = pytest.mark.pipeline

WAYS = [Orientation(turn, mirrored, None) for mirrored in (False, True) for turn in (0, 90, 180, 270)]


def laid(page: NDArray[np.uint8], way: Orientation) -> NDArray[np.uint8]:
    """The page as it lies when `way` is what makes it upright: turned back first, then flipped back."""
    turned = np.rot90(page, way.rotation_deg // 90)
    return np.ascontiguousarray(turned[:, ::-1] if way.mirrored else turned)


def page_of_flags(ink: int = 0, ground: int = 255) -> GrayImage:
    """Lines of the letter F made of bars: neither half a turn nor a flip brings it upon itself."""
    page = np.full((900, 900), ground, np.uint8)
    spaces = np.random.default_rng(2)
    for top in range(60, 850, 88):
        left = 60
        while left < 820:
            page[top : top + 24, left : left + 5] = ink
            page[top : top + 5, left : left + 15] = ink
            page[top + 9 : top + 13, left : left + 12] = ink
            left += int(spaces.choice([19, 20, 21, 22, 34]))
    return page


@dataclass
class FlagReader:
    """Reads lines of flags: confident about those that stand and face right, as Tesseract is about print."""

    name: str = "flags"
    good: tuple[str, float] = ("FFFFF FFFFF FFFFF", 0.95)
    poor: tuple[str, float] = ("dlld ljl '. dlj", 0.3)
    reads: int = 0
    directions: list[ReadDirection | None] = field(default_factory=list)

    def read_page(self, image: GrayImage) -> list[Word]:
        raise AssertionError("a whole page is not read for its orientation")

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        self.reads += 1
        assert image.shape[0] == 36
        if image.shape[1] < 600:
            return self.poor  # a fragment across the lines
        ink = 1.0 - image / 255.0
        upper, lower = ink[:18].sum(), ink[18:].sum()
        # A stem rises at once; its arms fall away in steps.
        steps = np.diff(ink.sum(axis=0))
        rising, falling = np.sum(steps[steps > 0] ** 3), np.sum(-(steps[steps < 0] ** 3))
        return self.good if upper > lower and rising > falling else self.poor


class DirectedReader(FlagReader):
    """Cannot read lines, but sees directions; the last one first."""

    def detect_direction(self, image: GrayImage) -> ReadDirection | None:
        return self.directions.pop()


@pytest.mark.parametrize("way", WAYS, ids=str)
@pytest.mark.parametrize("inverted", [False, True])
def test_every_way_is_found(way: Orientation, inverted: bool) -> None:
    page = page_of_flags(255, 20) if inverted else page_of_flags()
    reader = FlagReader()
    found = estimate_orientation(laid(page, way), reader)
    assert (found.rotation_deg, found.mirrored) == (way.rotation_deg, way.mirrored)
    assert found.confidence is not None
    assert found.confidence > 0.9
    assert np.array_equal(apply_orientation(laid(page, way), found), page)


@pytest.mark.parametrize("way", WAYS[:4], ids=str)
@pytest.mark.parametrize(
    ("letters", "confidence", "upright", "other"), [(15, 0.95, 6, 6), (30, 0.85, 2, 2), (30, 0.95, 1, 2)]
)
def test_an_evident_page_costs_one_reading_a_clear_one_two_and_short_lines_six(
    way: Orientation, letters: int, confidence: float, upright: int, other: int
) -> None:
    reader = FlagReader(good=(letters * "F", confidence))
    found = estimate_orientation(laid(page_of_flags(), way), reader)
    assert (found.rotation_deg, found.mirrored) == (way.rotation_deg, way.mirrored)
    assert reader.reads == (other if way.rotation_deg else upright)


@pytest.mark.parametrize(
    ("lines", "reads"),
    [
        ([(30, 0.7), (30, 0.95)], 2),
        ([(15, 0.95), (30, 0.7), (30, 0.95)], 3),
        ([(30, 0.85)], 2),  # clear: upside down is asked next
    ],
)
def test_lines_are_read_upright_until_one_is_evident(lines: list[tuple[int, float]], reads: int) -> None:
    class ListReader(FlagReader):
        def read_line(self, image: GrayImage) -> tuple[str, float]:
            super().read_line(image)
            letters, confidence = lines[self.reads - 1] if self.reads <= len(lines) else (30, 0.1)
            return letters * "F", confidence

    reader = ListReader()
    found = estimate_orientation(page_of_flags(), reader)
    assert (found.rotation_deg, found.mirrored, reader.reads) == (0, False, reads)
    assert found.confidence is not None
    assert found.confidence > 0.9


def test_mirrored_ways_are_not_tried_on_a_page_that_reads() -> None:
    page = page_of_flags()
    crops: list[GrayImage] = []

    class Listener(FlagReader):
        def read_line(self, image: GrayImage) -> tuple[str, float]:
            crops.append(image)
            return super().read_line(image)

    estimate_orientation(page, Listener())
    assert len(crops) == 6
    # Every crop is another one, or itself turned by half: none is a flipped one.
    for crop in crops:
        assert any(np.array_equal(crop, other[::-1, ::-1]) for other in crops)
        assert not any(np.array_equal(crop, other[:, ::-1]) for other in crops)


@pytest.mark.parametrize(
    ("good", "poor"),
    [
        (("abcde fghij", 0.35), ("abcde fghij", 0.35)),  # unknown script or handwriting: alike
        (("abcde fghij", 0.9), ("abcde fghij", 0.88)),  # reads in every way, so decides nothing
        (("", 0.0), ("", 0.0)),  # pictures
        (("ab", 0.99), ("", 0.0)),  # too few letters
        (("||| --- ...", 0.99), ("abcdefgh", 0.2)),  # confident about what is no text
    ],
)
def test_unreadable_page_is_left_as_it_is_with_low_confidence(
    good: tuple[str, float], poor: tuple[str, float]
) -> None:
    for way in WAYS[:4]:
        reader = FlagReader(good=good, poor=poor)
        found = estimate_orientation(laid(page_of_flags(), way), reader)
        assert (found.rotation_deg, found.mirrored) == (0, False)
        assert found.confidence is not None
        assert found.confidence < 0.5
        assert reader.reads <= 18 * 8


@pytest.mark.parametrize("lies_deg", [0, 90, 180, 270])
def test_unreadable_page_stays_as_it_lies_in_the_photo_if_its_lines_are_level_there(lies_deg: int) -> None:
    unread = FlagReader(good=("abcde fghij", 0.35), poor=("abcde fghij", 0.35))
    of_print = estimate_orientation(page_of_flags(), unread, lies_deg)
    assert of_print.rotation_deg == (0 if lies_deg in (90, 270) else lies_deg)
    picture = estimate_orientation(np.full((200, 300), 128, np.uint8), unread, lies_deg)
    assert picture.rotation_deg == lies_deg
    assert (of_print.confidence or 0.0) < 0.5
    assert picture.confidence == 0.0


def test_a_page_is_turned_against_its_photo_only_for_certain() -> None:
    doubtful = FlagReader(good=(30 * "F", 0.66), poor=(30 * "d", 0.42))
    page = laid(page_of_flags(), WAYS[2])
    as_it_lies = estimate_orientation(page, doubtful, WAYS[2].rotation_deg)
    assert as_it_lies.rotation_deg == WAYS[2].rotation_deg
    assert 0.5 <= (as_it_lies.confidence or 0.0) < 0.7
    against = estimate_orientation(page, doubtful, 0)
    assert against.rotation_deg == 0
    assert (against.confidence or 0.0) < 0.5


@pytest.mark.parametrize("turned_deg", [0, 90, 180, 270])
def test_direction_of_an_unknown_script_is_asked_of_the_engine(turned_deg: int) -> None:
    reader = DirectedReader(good=("abcdef", 0.3), poor=("abcdef", 0.3))
    reader.directions = [ReadDirection(turned_deg, 21.0)]
    found = estimate_orientation(page_of_flags(), reader)
    assert (turned_deg + found.rotation_deg) % 360 == 0
    assert found.confidence is not None
    assert 0.5 <= found.confidence <= 0.9


def test_less_confidence_is_enough_for_scripts_that_no_other_print_is_taken_for() -> None:
    page = page_of_flags()
    unread = ("abcdef", 0.3)
    readers = {script: DirectedReader(good=unread, poor=unread) for script in ("Han", "Cyrillic")}
    for script, reader in readers.items():
        reader.directions = [ReadDirection(180, 8.0, script)]
    assert estimate_orientation(page, readers["Han"]).rotation_deg == 180
    assert estimate_orientation(page, readers["Cyrillic"]).rotation_deg == 0, "mirrored Latin print may be it"


class FacelessReader(DirectedReader):
    """Sees which way up flags stand, and not which way they face."""

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        ink = 255 - image.astype(np.float64)
        return self.good if image.shape[1] >= 600 and ink[:18].sum() > ink[18:].sum() else self.poor


@pytest.mark.parametrize(("seen_deg", "turn_deg"), [(180, 180), (0, 0)])
def test_less_confidence_is_enough_for_a_direction_that_readings_found_too(
    seen_deg: int, turn_deg: int
) -> None:
    page = laid(page_of_flags(), Orientation(180, False, None))
    reader = FacelessReader(good=("abcdef abcdef abcdef", 0.55), poor=("abcdef abcdef abcdef", 0.3))
    reader.directions = [ReadDirection(seen_deg, 8.0, "Greek")]
    found = estimate_orientation(page, reader)
    assert found.rotation_deg == turn_deg
    assert ((found.confidence or 0.0) >= 0.5) == (seen_deg == 180)


HAN_UNSURE = ReadDirection(180, 5.0, "Han")


@pytest.mark.parametrize("again_deg", [0, 180])
def test_an_unsure_direction_counts_where_the_half_turned_page_is_sure_of_it(again_deg: int) -> None:
    reader = DirectedReader(good=("abcdef", 0.3), poor=("abcdef", 0.3))
    reader.directions = [ReadDirection(again_deg, 9.0, "Han"), HAN_UNSURE]
    found = estimate_orientation(page_of_flags(), reader)
    assert reader.directions == []
    assert found.rotation_deg == (180 if again_deg == 0 else 0)
    assert ((found.confidence or 0.0) >= 0.5) == (again_deg == 0)


@pytest.mark.parametrize(
    "directions",
    [
        [None],
        [ReadDirection(180, 5.0)],
        [ReadDirection(0, 5.0, "Han"), HAN_UNSURE],
        [ReadDirection(0, 9.0, "Hangul"), HAN_UNSURE],
        [None, HAN_UNSURE],
    ],
)
def test_doubtful_direction_is_not_believed(directions: list[ReadDirection | None]) -> None:
    reader = DirectedReader(good=("abcdef", 0.3), poor=("abcdef", 0.3), directions=directions.copy())
    found = estimate_orientation(page_of_flags(), reader)
    assert found.rotation_deg == 0
    assert found.confidence is not None
    assert found.confidence < 0.5


@pytest.mark.parametrize("shape", [(1, 1), (1, 900), (30, 30), (500, 400)])
@pytest.mark.parametrize("value", [0, 255])
def test_blank_page_is_not_read_at_all(shape: tuple[int, int], value: int) -> None:
    reader = FlagReader()
    assert estimate_orientation(np.full(shape, value, np.uint8), reader) == Orientation(0, False, 0.0)
    assert reader.reads == 0


@settings(max_examples=40, deadline=None)
@given(
    way=st.sampled_from(WAYS),
    height=st.integers(2, 9),
    width=st.integers(2, 9),
    seed=st.integers(0, 99),
    colour=st.booleans(),
)
def test_oriented_image_holds_the_same_pixels(
    way: Orientation, height: int, width: int, seed: int, colour: bool
) -> None:
    shape = (height, width, 3) if colour else (height, width)
    image = np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)
    oriented = apply_orientation(image, way)
    assert oriented.flags.c_contiguous
    assert np.array_equal(laid(oriented, way), image)
    # The top-left pixel goes round clockwise, from the top right where the page was flipped first.
    corners = {0: oriented[0, 0], 90: oriented[0, -1], 180: oriented[-1, -1], 270: oriented[-1, 0]}
    assert np.array_equal(corners[way.rotation_deg], image[0, -1 if way.mirrored else 0])


def print_with_picture() -> GrayImage:
    page = text_page(lines=9, height=900).copy()
    texture = np.random.default_rng(0).integers(0, 256, (30, 70), dtype=np.uint8)
    page[480:880, 60:840] = cv2.resize(texture, (780, 400), interpolation=cv2.INTER_CUBIC)
    return page


def print_in_columns_with_table() -> GrayImage:
    page = blank(1000, 1000)
    set_lines(page, (40, 40), 1, 70, words=3)
    set_lines(page, (40, 180), 14, 20, words=7)
    set_lines(page, (530, 180), 14, 20, words=7)
    draw = ImageDraw.Draw(page)
    for row in range(7):
        draw.line((40, 640 + 50 * row, 960, 640 + 50 * row), fill=0, width=2)
        for column in range(5):
            draw.line((40 + 184 * column, 640, 40 + 184 * column, 940), fill=0, width=2)
            number = f"{(row + 2) * 1234 * (column + 1) % 99991}"
            draw.text((60 + 184 * column, 650 + 50 * row), number, 0, ImageFont.load_default(24))
    return np.asarray(page, dtype=np.uint8)


def print_in_the_dark() -> GrayImage:
    page = np.full((1300, 1500), 15, np.uint8)
    page[200:1000, 300:1200] = text_page(lines=14, height=800)
    noise = np.random.default_rng(1).normal(0, 5, page.shape)
    return np.clip(page + noise, 0, 255).astype(np.uint8)


REAL_PAGES = {
    "page": lambda: text_page(lines=14, height=800),
    "two lines": lambda: text_page(lines=2, height=400),
    "light on dark": lambda: text_page(lines=14, height=800, ink=230, ground=30),
    "picture": print_with_picture,
    "columns and table": print_in_columns_with_table,
    "dark margins": print_in_the_dark,
}


@pytest.mark.long
@pytest.mark.parametrize("kind", some(3, [*REAL_PAGES]))
def test_real_engine_turns_print_upright(kind: str) -> None:
    engine = open_engine()
    if engine is None:
        assert importlib.util.find_spec("tesserocr") is None or find_tessdata("eng") is None
        return
    page = REAL_PAGES[kind]()
    for way in WAYS[:4]:
        found = estimate_orientation(laid(page, way), engine)
        assert (found.rotation_deg, found.mirrored) == (way.rotation_deg, False)
        assert found.confidence is not None
        assert found.confidence > 0.7


def test_real_engine_recognizes_a_mirrored_page() -> None:
    engine = open_engine()
    if engine is None:
        assert importlib.util.find_spec("tesserocr") is None or find_tessdata("eng") is None
        return
    page = text_page(lines=14, height=800)
    for way in WAYS[5:7]:
        found = estimate_orientation(laid(page, way), engine)
        assert (found.rotation_deg, found.mirrored) == (way.rotation_deg, True)
        assert found.confidence is not None
        assert found.confidence > 0.7
