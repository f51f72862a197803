"""Beside an outline the grain of a desk is no text of the sheet, and where print goes on the sheet does."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

from services.arrays import RgbImage
from services.contract.rectify import RectifyParameters
from services.imaging.reduction import Halves
from services.rectify.analysis.page_analysis import analyse_photo
from services.rectify.analysis.text_beside import text_beside
from services.rectify.pipeline import rectify
from services.sheet.outline.given_corners import outline_between

pytestmark = pytest.mark.pipeline
SHEET = np.array([[230, 200], [830, 230], [800, 1050], [190, 1010]], np.float64)
"""Corners in the photo, clockwise from the top left."""


def notepad_on_grain() -> RgbImage:
    """A sheet with three lines of print on a desk whose grain looks like upright characters."""
    rng = np.random.default_rng(1)
    desk = np.full((1200, 1000, 3), (176, 132, 92), np.float64)
    for x, y in rng.uniform([0, 0], [990, 1180], (900, 2)):
        length = int(rng.integers(8, 18))
        desk[int(y) : int(y) + length, int(x) : int(x) + int(rng.integers(2, 5))] *= 0.55
    page = Image.new("L", (600, 800), 240)
    draw = ImageDraw.Draw(page)
    for k, text in enumerate(("Something to give back", "Where value meets values", "A note on the desk")):
        draw.text((60, 50 + 60 * k), text, font=ImageFont.load_default(32), fill=30)
    flat = np.repeat(np.asarray(page, np.float64)[..., None], 3, axis=2)
    corners = np.array([[0, 0], [600, 0], [600, 800], [0, 800]], np.float32)
    H = cv2.getPerspectiveTransform(corners, SHEET.astype(np.float32))
    seen = cv2.warpPerspective(flat, H, (1000, 1200), flags=cv2.INTER_AREA)
    on_sheet = cv2.warpPerspective(np.ones((800, 600)), H, (1000, 1200)) > 0.5
    photo = np.where(on_sheet[..., None], seen, cv2.GaussianBlur(desk, (0, 0), 1.0))
    return np.clip(photo + rng.normal(0, 2, photo.shape), 0, 255).astype(np.uint8)


def test_the_view_is_cut_at_the_sheet_and_level_with_it() -> None:
    result = rectify(notepad_on_grain(), RectifyParameters(upright=False))
    assert result.kind == "planar"
    ends = result.mesh[[0, 0, -1, -1], [0, -1, -1, 0]]
    # The view's corners are the sheet's, to a few pixels.
    assert np.linalg.norm(ends - SHEET, axis=1).max() < 16


def page_round_a_picture() -> RgbImage:
    """A page larger than the photo, with four lines of print over a picture and twelve below it."""
    page = Image.new("L", (1000, 1200), 235)
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(30)
    for k in (*range(4), *range(13, 25)):
        draw.text(
            (60, 30 + 46 * k),
            "Alice was beginning to get very tired of sitting by her sister",
            font=font,
            fill=30,
        )
    draw.rectangle((60, 240, 940, 590), fill=60)
    photo = np.repeat(np.asarray(page, np.float64)[..., None], 3, axis=2)
    return np.clip(photo + np.random.default_rng(1).normal(0, 2, photo.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("end", "is_cut"), [(592, True), (900, True), (1199, False)])
def test_an_outline_with_rows_of_print_beside_it_is_no_end_of_the_sheet(end: int, is_cut: bool) -> None:
    photo = page_round_a_picture()
    analysis = analyse_photo(photo)
    outline = outline_between(Halves(photo), np.array([[5, 5], [994, 5], [994, end], [5, end]], np.float64))
    assert text_beside(analysis, outline) == ("print" if is_cut else None)


@pytest.mark.parametrize(("confidence", "found"), [(1.0, "texture"), (0.9, "texture"), (0.7, None)])
def test_grain_beside_a_believed_sheet_is_texture(confidence: float, found: str | None) -> None:
    photo = notepad_on_grain()
    analysis, outline = analyse_photo(photo), outline_between(Halves(photo), SHEET)
    assert text_beside(analysis, replace(outline, confidence=confidence)) == found


@pytest.mark.parametrize(("turned", "found"), [(True, "texture"), (False, "print")])
def test_rows_beside_an_outline_are_the_pages_along_its_lines(turned: bool, found: str) -> None:
    """Grain of oak forms rows as well, but across them."""
    font = ImageFont.load_default(30)
    page, desk = Image.new("L", (1000, 1000), 235), Image.new("L", (1000, 240), 150)
    for k in range(20):
        ImageDraw.Draw(page).text(
            (60, 30 + 46 * k), "Alice was beginning to get very tired of sitting", font=font
        )
    for k in range(5):
        ImageDraw.Draw(desk).text(
            (20, 10 + 44 * k), "of having nothing to do: once or twice she had", font=font
        )
    sheet, beside = np.asarray(page), np.asarray(desk)
    gap = 40
    photo = np.full((1000 + gap + 1000, 1000 + gap + 240), 150, np.uint8)
    photo[:1000, :1000] = sheet
    if turned:
        photo[:1000, 1000 + gap :] = np.rot90(beside)
    else:
        photo[1000 + gap : 1240 + gap, :1000] = beside
    rng = np.random.default_rng(1)
    seen = np.repeat(photo[..., None].astype(np.float64), 3, axis=2) + rng.normal(0, 2, (*photo.shape, 3))
    image = np.clip(seen, 0, 255).astype(np.uint8)
    outline = outline_between(Halves(image), np.array([[0, 0], [999, 0], [999, 999], [0, 999]], np.float64))
    assert text_beside(analyse_photo(image), outline) == found


@pytest.mark.parametrize(("right", "beside"), [(994, None), (800, "print"), (700, "print")])
def test_an_outline_that_rows_of_print_cross_is_no_end_of_the_sheet(right: int, beside: str | None) -> None:
    """As the shadow beside a book's gutter may be, which leaves the ends of all lines on its other side."""
    photo = page_round_a_picture()
    corners = np.array([[5, 5], [right, 5], [right, 1194], [5, 1194]], np.float64)
    outline = outline_between(Halves(photo), corners)
    assert text_beside(analyse_photo(photo), replace(outline, confidence=0.95)) == beside
