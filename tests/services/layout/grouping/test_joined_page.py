"""The page of joined zones: boxes, lines, texts and words of all pieces, in reading order."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from services.layout.grouping.joined_page import in_pieces, join_page
from services.layout.page import Page, Zone
from services.layout.segmentation import FinePage, compose_with_lines, segment_finely
from services.layout.segmentation.measures import order_by_rows
from services.ocr.engine import Word

LINES = ((60, "Acme and Sons"), (200, "Dear Ms Roe"), (340, "Yours truly"))


@pytest.fixture(scope="module")
def fine() -> FinePage:
    """Three lines, far apart, with a picture beside the first."""
    image = np.full((460, 900), 255, dtype=np.uint8)
    words = []
    for y, text in LINES:
        cv2.putText(image, text, (80, y), cv2.FONT_HERSHEY_SIMPLEX, 1.0, 0, 2, cv2.LINE_AA)
        x = 80
        for each in text.split():
            (width, _), _ = cv2.getTextSize(each + " ", cv2.FONT_HERSHEY_SIMPLEX, 1.0, 2)
            words.append(Word(each, (float(x), y - 24.0, float(x + width - 16), y + 4.0), 0.9))
            x += width
    cv2.ellipse(image, (640, 70), (120, 50), 0, 0, 360, 0, 9)
    cv2.line(image, (540, 40), (740, 100), 0, 9)
    return segment_finely(image, words)


def of_text(page: Page, text: str) -> int:
    return next(place for place, zone in enumerate(page.zones) if text in zone.text)


def test_lines_of_pieces_are_lines_of_their_zone(fine: FinePage) -> None:
    page, lines = compose_with_lines(fine)
    first, second = of_text(page, "Acme"), of_text(page, "Dear")
    rest = [(place,) for place in range(len(page.zones)) if place not in (first, second)]
    joined, _ = join_page(fine, page, lines, ((second, first), *rest))
    zone = joined.zones[of_text(joined, "Acme")]
    assert len(joined.zones) == len(page.zones) - 1
    assert zone.text == "Acme and Sons\nDear Ms Roe"
    assert zone.lines == 2
    assert [(word.text, word.line) for word in zone.words][2:4] == [("Sons", 0), ("Dear", 1)]
    a, b = page.zones[first].box, page.zones[second].box
    assert zone.box == (min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3]))
    assert [each.id for each in joined.zones] == [f"z{number}" for number in range(1, len(joined.zones) + 1)]


def test_a_caption_comes_before_its_value_that_stands_a_pixel_higher(fine: FinePage) -> None:
    line = fine.lines[0]
    value, caption, below = (
        replace(line, baseline=baseline) for baseline in (100.0, 100.0 + 0.2 * line.em, 100.0 + 1.4 * line.em)
    )
    assert order_by_rows([value, below, caption], [300.0, 50.0, 80.0]) == [2, 0, 1]


def test_a_picture_joined_with_text_is_text_in_the_box_of_both(fine: FinePage) -> None:
    page, lines = compose_with_lines(fine)
    first = of_text(page, "Acme")
    picture = next(place for place, zone in enumerate(page.zones) if zone.kind == "figure")
    joined, _ = join_page(fine, page, lines, ((first, picture),))
    [zone] = joined.zones
    assert (zone.kind, zone.text, zone.lines) == ("text", "Acme and Sons", 1)
    assert zone.box[2] == page.zones[picture].box[2]


def test_pictures_without_text_are_one_picture(fine: FinePage) -> None:
    zones = (Zone("a", (0.0, 0.0, 10.0, 10.0), "noise"), Zone("b", (20.0, 0.0, 30.0, 10.0), "figure"))
    [zone] = join_page(fine, Page(900.0, 460.0, zones), ((), ()), ((0, 1),))[0].zones
    assert (zone.kind, zone.box) == ("figure", (0.0, 0.0, 30.0, 10.0))


def test_zones_alone_stay_as_they_are(fine: FinePage) -> None:
    page, lines = compose_with_lines(fine)
    alone = tuple((place,) for place in range(len(page.zones)))
    assert join_page(fine, page, lines, alone) == (page, alone)


def test_a_joined_zone_remembers_its_pieces(fine: FinePage) -> None:
    page, lines = compose_with_lines(fine)
    joined, _ = join_page(fine, page, lines, ((0, 1), *((place,) for place in range(2, len(page.zones)))))
    [zone] = [zone for zone in joined.zones if zone.pieces]
    assert set(zone.pieces) == {page.zones[0].box, page.zones[1].box}
    parts = in_pieces(joined)
    assert sorted(each.box for each in parts.zones) == sorted(each.box for each in page.zones)
    assert len({each.id for each in parts.zones}) == len(parts.zones)
    assert in_pieces(page) is page
