"""The overlay: every zone is seen, nothing leaves the picture, any page and any label can be drawn."""

import numpy as np
import pytest
from hypothesis import given, settings

from services.arrays import RgbImage
from services.layout.page import Box, Kind, Page, Zone
from services.layout.recognition.results import ClassMatch, Recognition, RecognizedZone
from services.layout.rendering.overlay import (
    MAX_SIDE_PX,
    MIN_SIDE_PX,
    PALETTE,
    draw_overlay,
    label_colour,
    place_of_page,
)
from tests.services.layout.exchange.pages import pages, recognized

HEADER_ACCENT = (98, 202, 182)


def recognition(
    *zones: tuple[Box, str | None],
    confidence: float = 0.95,
    size: tuple[float, float] = (1000, 1400),
    kind: Kind = "text",
) -> Recognition:
    labelled = tuple(
        RecognizedZone(Zone(f"z{order}", box, kind), label, confidence, label, order)
        for order, (box, label) in enumerate(zones)
    )
    return Recognition(Page(*size, tuple(zone.zone for zone in labelled)), labelled, None)


def count(picture: RgbImage, colour: tuple[int, int, int]) -> int:
    return int((picture == np.array(colour)).all(axis=2).sum())


@given(pages())
@settings(max_examples=25, deadline=None)
def test_any_page_is_drawn(page: Page) -> None:
    picture = draw_overlay(None, recognized(page))
    assert picture.dtype == np.uint8
    assert MIN_SIDE_PX <= max(picture.shape[:2]) <= MAX_SIDE_PX
    assert min(picture.shape[:2]) > 100


@pytest.mark.parametrize(
    "size", [(1, 1), (100_000, 1), (1, 100_000), (100_000, 100_000), (200, 300), (2480, 3508)]
)
def test_pages_of_any_size(size: tuple[float, float]) -> None:
    picture = draw_overlay(None, recognition(((0, 0, size[0] / 2, size[1] / 2), "title"), size=size))
    assert max(picture.shape[:2]) <= MAX_SIDE_PX
    assert count(picture, label_colour("title")) > 100


def test_the_image_is_seen_in_any_size() -> None:
    image = np.full((70, 50, 3), 255, np.uint8)
    image[:35] = (0, 0, 0)
    picture = draw_overlay(image, recognition())
    rows = picture[:, picture.shape[1] // 2].mean(axis=1)
    assert rows[-1] == 255
    assert 30 < rows[len(rows) // 4] < 90, "ink is dimmed"


@pytest.mark.parametrize("size", [(1000, 1400), (3000, 2000), (300, 400)])
def test_a_point_of_the_page_is_found_in_the_picture(size: tuple[float, float]) -> None:
    box = (0.4 * size[0], 0.5 * size[1], 0.6 * size[0], 0.7 * size[1])
    page = recognition((box, "body"), size=size)
    scale_x, scale_y, left, top = place_of_page(page)
    rows, columns = np.nonzero((draw_overlay(None, page) == np.array(label_colour("body"))).all(axis=2))
    frame = 4  # the outline lies around the print
    assert columns.min() == pytest.approx(box[0] * scale_x + left, abs=frame)
    assert columns.max() == pytest.approx(box[2] * scale_x + left, abs=frame)
    assert rows.max() == pytest.approx(box[3] * scale_y + top, abs=frame)


def test_zones_have_the_colours_of_their_labels_and_an_empty_one_is_dashed() -> None:
    boxes = ((100, 200, 900, 400), (100, 800, 900, 1000))
    solid = draw_overlay(None, recognition((boxes[0], "body"), (boxes[1], "date")))
    assert count(solid, label_colour("body")) > 2000
    assert count(solid, label_colour("date")) > 2000
    dashed = draw_overlay(None, recognition((boxes[0], None)))
    assert 0.5 < count(dashed, label_colour(None)) / (2 * (800 + 200) * 2) < 0.8
    assert dashed[350, 500].tolist() == [255, 255, 255], "not tinted"


def test_a_doubtful_label_says_how_probable_it_is() -> None:
    box = (100, 200, 900, 400)
    colour = label_colour("body")
    sure = draw_overlay(None, recognition((box, "body"), confidence=0.8))
    doubtful = draw_overlay(None, recognition((box, "body"), confidence=0.79))
    assert count(doubtful, colour) > count(sure, colour) + 200, "a longer chip"


def test_noise_has_no_chip() -> None:
    box = (100, 200, 900, 400)
    noise = draw_overlay(None, recognition((box, None), kind="noise"))
    text = draw_overlay(None, recognition((box, None)))
    above = slice(50, 240)
    assert (noise[above] == 255).all()
    assert (text[above] != 255).any()


@pytest.mark.parametrize("probability", [0.0, 0.25, 1.0])
def test_the_header_shows_the_class_and_how_probable_it_is(probability: float) -> None:
    chosen = ClassMatch("letter", 1, 1.0, probability)
    page = recognition()
    found = draw_overlay(None, Recognition(page.page, (), chosen, (chosen,)))
    bar = next(row for row in found[::-1] if tuple(row[-1]) != (255, 255, 255))
    filled = (bar == np.array(HEADER_ACCENT)).all(axis=1).mean()
    assert filled == pytest.approx(probability, abs=0.002)
    unknown = draw_overlay(None, Recognition(page.page, (), None, (chosen,), unknown_probability=0.9))
    none = draw_overlay(None, page)
    assert (found[:40] != unknown[:40]).any()
    assert (none[:40] != unknown[:40]).any()


@pytest.mark.parametrize(
    "name", ["x" * 500, "\u00dcberschrift", "\u043f\u0438\u0441\u044c\u043c\u043e", "\ud800", "a\nb"]
)
def test_names_of_any_kind_are_drawn(name: str) -> None:
    chosen = ClassMatch(name, 1, 1.0, 0.5)
    page = recognition(((0, 0, 10, 10), name))
    picture = draw_overlay(None, Recognition(page.page, page.zones, chosen, (chosen, chosen)))
    assert max(picture.shape[:2]) <= MAX_SIDE_PX


def test_colours_are_stable_and_those_of_one_page_differ() -> None:
    title_page = [
        "title",
        "author",
        "affiliation",
        "abstract",
        "keywords",
        "date",
        "section-title",
        "body",
        "footnote",
    ]
    letter = [
        "letterhead",
        "receiver",
        "subject",
        "salutation",
        "date",
        "body",
        "closing",
        "signature",
        "enclosure",
    ]
    for labels in (title_page, letter):
        assert len({label_colour(label) for label in labels}) == len(labels)
    assert label_colour("a label of one's own") == label_colour("a label of one's own")
    assert {label_colour(f"label {number}") for number in range(200)} == set(PALETTE)
    assert label_colour(None) not in PALETTE
