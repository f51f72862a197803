"""How the ink of zones looks."""

from dataclasses import astuple

import cv2
import numpy as np
import pytest

from services.arrays import GrayImage
from services.layout.page import InkAppearance, Page, Zone
from services.layout.segmentation import measure_zones, segment_page
from tests.services.layout.segmentation.pages import drawing, sample

LINE = (100.0, 95.0, 500.0, 125.0)
SCRAWL = (100.0, 240.0, 500.0, 340.0)


def row_and_scrawl() -> GrayImage:
    """A page with rows of upright strokes on one baseline, and below it leaning strokes of many sizes and feet."""
    page = np.full((600, 600), 255, np.uint8)
    for top in (100, 140, 180):
        for x in range(105, 495, 15):
            cv2.rectangle(page, (x, top), (x + 3, top + 19), 0, -1)
    rng = np.random.default_rng(5)
    for x in range(110, 480, 24):
        length, foot = int(rng.integers(14, 60)), int(rng.integers(280, 335))
        cv2.line(page, (x, foot), (x + length // 3, foot - length), 0, 2)
    return page


def appearance(image: GrayImage, box: tuple[float, float, float, float]) -> InkAppearance:
    height, width = image.shape
    [zone] = measure_zones(image, Page(float(width), float(height), (Zone("a", box, kind="figure"),))).zones
    assert zone.appearance is not None
    return zone.appearance


def test_print_is_regular_and_scrawl_is_not() -> None:
    image = row_and_scrawl()
    print_, scrawl = appearance(image, LINE), appearance(image, SCRAWL)
    assert print_.regularity == 1.0
    assert print_.size == pytest.approx(1.0, abs=0.1)
    assert print_.size_spread < 0.1
    assert print_.stroke == pytest.approx(1.0, abs=0.1)
    assert print_.slant == pytest.approx(0.0, abs=0.02)
    # 26 strokes of 4 x 20 px in a box of 400 x 30 px.
    assert print_.density == pytest.approx(26 * 4 * 20 / (400 * 30), rel=0.1)
    assert scrawl.regularity < 0.7
    assert scrawl.size > 1.4
    assert scrawl.size_spread > 0.3
    assert scrawl.stroke < 0.9
    assert scrawl.slant == pytest.approx(1 / 3, abs=0.08)
    assert scrawl.density < print_.density


def test_appearance_does_not_depend_on_the_size_of_the_image() -> None:
    image = row_and_scrawl()
    large = np.asarray(cv2.resize(image, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_NEAREST), np.uint8)
    for box in (LINE, SCRAWL):
        x0, y0, x1, y1 = box
        same = appearance(large, (2 * x0, 2 * y0, 2 * x1, 2 * y1))
        assert astuple(same) == pytest.approx(astuple(appearance(image, box)), rel=0.1, abs=0.05)


def test_drawn_zones_look_as_found_ones() -> None:
    image = drawing(sample("letter", 1))
    page = segment_page(image, None)
    drawn = tuple(Zone(zone.id, zone.box, kind=zone.kind) for zone in page.zones)
    measured = measure_zones(image, Page(page.width, page.height, drawn))
    assert [zone.appearance for zone in measured.zones] == [zone.appearance for zone in page.zones]
    assert any(zone.appearance is not None for zone in page.zones)


def test_zones_without_ink_have_no_appearance() -> None:
    image = row_and_scrawl()
    given = InkAppearance(0.5, 1.0, 0.1, 1.0, 0.0, 1.0)
    zones = (
        Zone("empty", (10.0, 400.0, 500.0, 500.0)),
        Zone("known", LINE, appearance=given),
        Zone("outside", (700.0, 700.0, 800.0, 800.0)),
    )
    empty, known, outside = measure_zones(image, Page(600.0, 600.0, zones)).zones
    assert empty.appearance is None
    assert outside.appearance is None
    assert known.appearance == given
