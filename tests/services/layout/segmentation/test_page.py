"""Segmentation of whole pages: drawn letters and papers, and what must not break it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from services.arrays import GrayImage
from services.layout.page import Page, Zone
from services.layout.segmentation import segment_page
from tests.services.layout.segmentation.pages import (
    Box,
    drawing,
    sample,
    turned,
    whole_share,
    words_of,
)

pytestmark = pytest.mark.pipeline

KINDS = ("letter", "memo", "plain", "two-column", "margin")


def boxes(page: Page) -> list[Box]:
    return [zone.box for zone in page.zones if zone.kind in ("text", "figure")]


def true_boxes(kind: str, seed: int) -> list[Box]:
    return [zone.box for zone in sample(kind, seed).zones if zone.kind == "text"]


def found_share(image: GrayImage, truth: list[Box]) -> float:
    return whole_share(truth, boxes(segment_page(image, None)))


@pytest.mark.parametrize("kind", KINDS)
def test_zones_of_drawn_pages_are_found_whole(kind: str) -> None:
    shares = [found_share(drawing(sample(kind, seed)), true_boxes(kind, seed)) for seed in (1, 2, 3)]
    assert np.mean(shares) > 0.8


@pytest.mark.parametrize("kind", KINDS)
def test_few_zones_are_found_where_there_is_nothing(kind: str) -> None:
    page = sample(kind, 4)
    found = boxes(segment_page(drawing(page), None))
    truth: list[Box] = [zone.box for zone in page.zones]

    def covered(box: Box) -> float:
        mask = np.zeros((page.height, page.width), dtype=bool)
        for x0, y0, x1, y1 in truth:
            mask[int(y0) : int(y1) + 1, int(x0) : int(x1) + 1] = True
        x0, y0, x1, y1 = (round(edge) for edge in box)
        return float(mask[y0:y1, x0:x1].mean())

    spurious = [box for box in found if covered(box) < 0.5]
    assert len(spurious) <= 1
    assert len(found) <= 1.6 * len(truth) + 2


@pytest.mark.parametrize("degrees", [-2.0, -0.7, 2.0])
def test_skew_is_undone_in_computing_only(degrees: float) -> None:
    for kind in ("letter", "two-column"):
        image, turn = turned(drawing(sample(kind, 5)), degrees)
        truth: list[Box] = []
        for x0, y0, x1, y1 in true_boxes(kind, 5):
            corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) @ turn[:, :2].T + turn[:, 2]
            truth.append((*corners.min(axis=0), *corners.max(axis=0)))
        level = found_share(drawing(sample(kind, 5)), true_boxes(kind, 5))
        # The true boxes of turned zones are looser than those of their ink.
        assert whole_share(truth, boxes(segment_page(image, None)), 0.5) > level - 0.15


def test_light_print_on_a_dark_page_is_print() -> None:
    image = drawing(sample("letter", 1))
    dark = segment_page(image, None)
    light = segment_page(np.asarray(255 - image, dtype=np.uint8), None)
    assert boxes(light) == boxes(dark)


def test_uneven_light_and_noise_change_little() -> None:
    truth = true_boxes("letter", 2)
    image = drawing(sample("letter", 2)).astype(np.float64)
    height, width = image.shape
    shade = np.linspace(1.0, 0.45, width)[None, :] * np.linspace(1.0, 0.8, height)[:, None]
    noise = np.random.default_rng(1).normal(0.0, 8.0, image.shape)
    spoiled = np.clip((0.15 * 255 + 0.85 * image) * shade + noise, 0, 255).astype(np.uint8)
    assert found_share(spoiled, truth) > found_share(drawing(sample("letter", 2)), truth) - 0.15


def test_specks_and_dark_borders_change_little() -> None:
    truth = true_boxes("letter", 3)
    image = drawing(sample("letter", 3)).copy()
    rng = np.random.default_rng(2)
    height, width = image.shape
    for x, y in rng.integers([30, 30], [width - 30, height - 30], (600, 2)):
        image[y : y + int(rng.integers(1, 4)), x : x + int(rng.integers(1, 4))] = 0
    image[:, :14] = 0
    image[-20:, :] = 30
    page = segment_page(image, None)
    assert whole_share(truth, boxes(page)) > found_share(drawing(sample("letter", 3)), truth) - 0.2
    assert len(boxes(page)) < 2.5 * len(truth) + 5


def test_resolution_changes_little() -> None:
    kind, seed = "margin", 2
    coarse, fine = (
        segment_page(drawing(sample(kind, seed)), None),
        segment_page(drawing(sample(kind, seed, 2.0)), None),
    )
    halved: list[Box] = [(b[0] / 2, b[1] / 2, b[2] / 2, b[3] / 2) for b in boxes(fine)]
    assert whole_share(boxes(coarse), halved) > 0.9
    sizes = [np.median([zone.font_size for zone in page.zones if zone.font_size]) for page in (coarse, fine)]
    assert sizes[1] == pytest.approx(2 * sizes[0], rel=0.06)


@pytest.mark.parametrize("shape", [(1, 1), (1, 500), (3, 3), (40, 40), (1650, 1275)])
@pytest.mark.parametrize("level", [0, 128, 255])
def test_a_blank_page_has_no_zones(shape: tuple[int, int], level: int) -> None:
    page = segment_page(np.full(shape, level, dtype=np.uint8), [])
    assert (page.width, page.height, page.zones) == (float(shape[1]), float(shape[0]), ())


def test_pure_noise_is_no_text_to_speak_of() -> None:
    image = np.random.default_rng(3).integers(0, 256, (900, 700)).astype(np.uint8)
    page = segment_page(image, None)
    assert len(page.zones) < 150
    assert sum((zone.lines or 0) > 1 for zone in page.zones) < 5


def test_one_line_is_one_zone() -> None:
    image = np.full((400, 900), 255, dtype=np.uint8)
    cv2.putText(image, "Reference number 4711", (80, 200), cv2.FONT_HERSHEY_SIMPLEX, 1.2, 0, 3, cv2.LINE_AA)
    [zone] = segment_page(image, None).zones
    assert (zone.id, zone.kind, zone.lines, zone.text) == ("z1", "text", 1, "")
    ys, xs = np.nonzero(image < 128)
    assert zone.box == pytest.approx((xs.min(), ys.min(), xs.max() + 1, ys.max() + 1), abs=3)


def test_a_large_page_is_reduced() -> None:
    image = cv2.resize(drawing(sample("letter", 1)), None, fx=4, fy=4, interpolation=cv2.INTER_LINEAR)
    truth: list[Box] = [(4 * b[0], 4 * b[1], 4 * b[2], 4 * b[3]) for b in true_boxes("letter", 1)]
    assert found_share(np.asarray(image, dtype=np.uint8), truth) > 0.75


def zone_at(page: Page, box: Box) -> Zone:
    """The zone that holds the middle of a box."""
    x, y = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    return next(
        zone
        for zone in page.zones
        if zone.box[0] <= x <= zone.box[2] and zone.box[1] <= y <= zone.box[3] and zone.kind == "text"
    )


def test_words_become_the_text_of_their_zones() -> None:
    truth = sample("plain", 1)
    page = segment_page(drawing(truth), words_of(truth))
    title = next(zone for zone in truth.zones if zone.label == "title")
    found = zone_at(page, title.box)
    assert found.text == title.text
    assert found.lines == title.lines
    assert {zone.text for zone in segment_page(drawing(truth), None).zones} == {""}


def test_a_badly_read_word_stays_in_a_line_that_is_text() -> None:
    """It is left out only where all of its line was read badly."""
    truth = sample("plain", 1)
    title = next(zone for zone in truth.zones if zone.label == "title")
    words = words_of(truth)

    def text_with(*unsure: str) -> str:
        read = [replace(word, confidence=0.1) if word.text in unsure else word for word in words]
        return zone_at(segment_page(drawing(truth), read), title.box).text

    each = title.text.split()
    assert text_with(each[1]) == title.text
    assert text_with(*each) == ""


def test_zones_come_in_reading_order() -> None:
    truth = sample("two-column", 2)
    page = segment_page(drawing(truth), None)
    assert [zone.id for zone in page.zones] == [f"z{k}" for k in range(1, len(page.zones) + 1)]
    order = [page.zones.index(zone_at(page, zone.box)) for zone in truth.zones if zone.label == "body"]
    assert order == sorted(order)


def test_measures_are_those_of_the_print() -> None:
    truth = sample("plain", 3)
    page = segment_page(drawing(truth), None)
    body = [zone for zone in truth.zones if zone.label in ("body", "abstract") and zone.lines > 3]
    for zone in body:
        found = zone_at(page, zone.box)
        assert found.lines == zone.lines
        assert found.font_size == pytest.approx(zone.font_size, rel=0.12)
        assert found.line_spacing == pytest.approx(
            (zone.box[3] - zone.box[1] - 0.9 * zone.font_size) / (zone.lines - 1), rel=0.1
        )
        assert found.weight is not None
        assert 0.03 < found.weight < 0.25
        assert found.alignment in ("justified", "left")
