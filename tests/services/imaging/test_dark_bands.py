"""Dark bands with light print are turned; print, rules and pictures are not."""

import cv2
import numpy as np
import pytest

from services.arrays import GrayImage
from services.imaging.dark_bands import with_bands_turned

PAPER, GROUND, LIGHT = 235, 60, 250


def page_with_text() -> GrayImage:
    page = np.full((900, 1000), PAPER, np.uint8)
    cv2.putText(page, "Subtotal 1,166.00", (120, 200), cv2.FONT_HERSHEY_SIMPLEX, 1.0, 20, 2, cv2.LINE_AA)
    return page


def with_band(page: GrayImage, box: tuple[int, int, int, int], text: str = "TOTAL 1,357.22") -> GrayImage:
    left, top, right, bottom = box
    page[top:bottom, left:right] = GROUND
    cv2.putText(page, text, (left + 20, bottom - 12), cv2.FONT_HERSHEY_SIMPLEX, 0.9, LIGHT, 2, cv2.LINE_AA)
    return page


def test_a_band_becomes_its_negative_and_nothing_else_changes() -> None:
    page = with_band(page_with_text(), (300, 400, 700, 442))
    turned = with_bands_turned(page)
    band = np.s_[400:442, 300:700]
    assert (turned[band][page[band] == GROUND] == PAPER).all()
    assert (turned[band][page[band] == LIGHT] < 20).all()
    kept = np.ones(page.shape, bool)
    kept[band] = False
    assert np.array_equal(turned[kept], page[kept])


def test_a_band_at_the_edge_of_the_page_is_one() -> None:
    page = with_band(page_with_text(), (0, 850, 1000, 900))
    assert (with_bands_turned(page)[850:][page[850:] == GROUND] == PAPER).all()


def test_round_corners_stay_paper() -> None:
    page = page_with_text()
    cv2.rectangle(page, (320, 400), (680, 441), GROUND, -1)
    cv2.circle(page, (320, 421), 20, GROUND, -1)
    cv2.putText(page, "PAYABLE", (350, 430), cv2.FONT_HERSHEY_SIMPLEX, 0.9, LIGHT, 2, cv2.LINE_AA)
    turned = with_bands_turned(page)
    assert turned[401, 302] == PAPER
    assert turned[421, 302] == PAPER


@pytest.mark.parametrize("kind", ["nothing", "bar", "rule", "picture", "faint", "letters"])
def test_what_is_no_band_stays(kind: str) -> None:
    page = page_with_text()
    if kind == "bar":
        page[400:440, 300:700] = GROUND
    elif kind == "rule":
        page[400:404, 100:900] = GROUND
    elif kind == "picture":
        noise = np.random.default_rng(1).integers(0, 150, (200, 400), np.uint8)
        page[400:600, 300:700] = cv2.GaussianBlur(noise, (0, 0), 2)
        page[400:600:20, 300:700] = LIGHT
    elif kind == "letters":
        cv2.putText(page, "LATEX", (300, 500), cv2.FONT_HERSHEY_SIMPLEX, 4.0, GROUND, 30, cv2.LINE_AA)
    elif kind == "faint":
        page[400:442, 300:700] = GROUND
        cv2.putText(page, "TOTAL", (320, 430), cv2.FONT_HERSHEY_SIMPLEX, 0.9, GROUND + 40, 2, cv2.LINE_AA)
    assert with_bands_turned(page) is page


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (7, 30), (90, 95)])
def test_small_pages_are_taken(size: tuple[int, int]) -> None:
    page = np.full(size, PAPER, np.uint8)
    page[: size[0] // 2] = GROUND
    assert with_bands_turned(page).shape == size
