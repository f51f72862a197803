"""The sheet on the whole mosaic."""

from dataclasses import replace
from typing import cast

import cv2
import numpy as np
import pytest

from services.geometry.focal_prior import typical_focal_prior
from services.geometry.homographies import translation
from services.mosaic.flat_photo import SeenPage
from services.mosaic.page_cropping import PageCells, crop_page, find_page_crop, see_sheet
from services.sheet.evidence import PageEvidence
from services.sheet.plane.flat_photo import PhotoAsPage
from tests.services.mosaic.cuttings import place
from tests.services.mosaic.views import page_image

pytestmark = pytest.mark.pipeline


def seen_all(page: np.ndarray) -> PageCells:
    """Photos that show all of the page, and tell no edge."""
    cells = np.ones(
        (round(page.shape[0] * 600 / max(page.shape)), round(page.shape[1] * 600 / max(page.shape))), bool
    )
    return PageCells(cells, cells)


def on_desk(border: int = 60) -> np.ndarray:
    return cv2.copyMakeBorder(page_image(), *(border,) * 4, cv2.BORDER_CONSTANT, value=(90, 70, 50))


@pytest.mark.parametrize("turned_deg", [0.0, 1.2])
def test_a_sheet_on_a_desk_is_cut_out(turned_deg: float) -> None:
    desk = on_desk()
    height, width = desk.shape[:2]
    turn = cv2.getRotationMatrix2D((width / 2, height / 2), turned_deg, 1.0)
    desk = np.asarray(cv2.warpAffine(desk, turn, (width, height), borderValue=(90, 70, 50)), np.uint8)
    crop = find_page_crop(desk, seen_all(desk))
    assert len(crop.edges) == 4
    page = crop_page(desk, crop)
    grown = 1 + 1.7 * abs(np.sin(np.radians(turned_deg)))
    assert 985 < page.shape[1] < 1006 * grown
    assert 1545 < page.shape[0] < 1566 * grown
    # Nothing of the desk is left, and nothing of the print is lost.
    assert (page.max(axis=2) < 120).sum() == pytest.approx((page_image()[..., 0] < 120).sum(), rel=0.02)
    assert np.median(page[:, :4]) == np.median(page[-4:]) == 255


def test_only_the_edges_that_are_seen_are_cut() -> None:
    beside = cv2.copyMakeBorder(page_image(), 0, 0, 70, 0, cv2.BORDER_CONSTANT, value=(90, 70, 50))
    crop = find_page_crop(beside, seen_all(beside))
    assert len(crop.edges) == 1
    assert (crop.top, crop.right, crop.bottom) == (0, 1070, 1560)
    assert 68 < crop.left < 76


def test_a_page_that_fills_the_mosaic_is_left_alone() -> None:
    crop = find_page_crop(page_image(), seen_all(page_image()))
    assert (crop.left, crop.top, crop.right, crop.bottom) == (0, 0, 1000, 1560)
    before = page_image()
    assert np.array_equal(crop_page(before.copy(), crop), before)


def test_a_picture_at_the_border_of_the_page_is_no_desk() -> None:
    page = page_image().copy()
    page[300:800, :330] = (60, 90, 70)
    crop = find_page_crop(page, seen_all(page))
    assert (crop.left, crop.top, crop.right, crop.bottom) == (0, 0, 1000, 1560)


def test_the_border_of_the_photos_is_no_edge_of_the_sheet() -> None:
    # Three quarters were photographed; beside the sheet lies the desk.
    mosaic = on_desk()
    covered = np.ones(mosaic.shape[:2], bool)
    covered[900:, 600:] = False
    mosaic[~covered] = 255
    cells = cv2.resize(covered.astype(np.uint8), (400, 600), interpolation=cv2.INTER_NEAREST).astype(bool)
    crop = find_page_crop(mosaic, PageCells(cells, cells))
    page = crop_page(mosaic.copy(), crop)
    assert len(crop.edges) == 4
    left, top = 60 - crop.left, 60 - crop.top
    kept = page_image()
    assert np.array_equal(page[top + 20 : top + 830, left + 20 : left + 980], kept[20:830, 20:980])
    assert np.array_equal(page[top + 850 : top + 1500, left + 20 : left + 530], kept[850:1500, 20:530])


def test_without_text_nothing_is_cropped() -> None:
    crop = find_page_crop(
        np.full((300, 200, 3), 255, np.uint8), seen_all(np.full((300, 200, 3), 255, np.uint8))
    )
    assert (crop.left, crop.top, crop.right, crop.bottom, len(crop.edges)) == (0, 0, 200, 300, 0)


@pytest.mark.parametrize("ink", [0.0, 250.0])
def test_a_coloured_head_with_print_on_it_is_not_cut_off(ink: float) -> None:
    page = page_image().astype(np.float32)
    page[:620] = ink + page[:620] / 255 * (np.array([110.0, 80, 60]) - ink)
    seen = seen_all(page).seen
    # The photos take the head for ground.
    paper = seen.copy()
    paper[: round(620 * seen.shape[0] / 1560)] = False
    crop = find_page_crop(page.astype(np.uint8), PageCells(seen, paper))
    assert (crop.left, crop.top, crop.right, crop.bottom) == (0, 0, 1000, 1560)


@pytest.mark.parametrize("are_pages", [False, True])
def test_a_coloured_head_with_little_print_is_cut_off_unless_the_photos_are_the_page(are_pages: bool) -> None:
    page = page_image()
    page[:80] = (90, 92, 8)
    seen = seen_all(page).seen
    paper = seen.copy()
    paper[: round(80 * seen.shape[0] / 1560)] = False
    crop = find_page_crop(page, PageCells(seen, paper, are_pages=are_pages))
    assert (crop.top < 70, len(crop.edges)) == ((True, 0) if are_pages else (False, 1))


def test_photos_are_the_page_only_where_each_was_taken_for_it() -> None:
    placed = [place(page_image()[:900], translation(0, 0)), place(page_image()[700:], translation(0, 700), 1)]
    evidence, prior = cast(PageEvidence, None), typical_focal_prior()
    page = SeenPage(PhotoAsPage(0.0, 1.3, None), evidence, prior)
    known = [replace(photo, flat=replace(photo.flat, page=page)) for photo in placed]
    assert see_sheet(known, 1000, 1560).are_pages
    assert not see_sheet([known[0], placed[1]], 1000, 1560).are_pages
    # A sheet on a desk that a photo shows all round.
    sheet = np.array([[60.0, 60.0], [900.0, 60.0], [900.0, 800.0], [60.0, 800.0]])
    beside = replace(known[0], flat=replace(known[0].flat, sheet=sheet))
    assert not see_sheet([beside, known[1]], 1000, 1560).are_pages


@pytest.mark.parametrize("desk_in_photo", [True, False])
def test_what_is_as_bright_as_paper_is_told_in_the_photos_own_light(desk_in_photo: bool) -> None:
    # Beside the right edge a part of the desk came out white, as would a margin with a picture in it.
    bordered = cv2.copyMakeBorder(page_image(), 0, 0, 0, 160, cv2.BORDER_CONSTANT, value=(90, 70, 50))
    mosaic = np.asarray(bordered, np.uint8)
    mosaic[500:1100, 1000:1120] = 255
    cells = seen_all(mosaic)
    view = np.full((*cells.seen.shape, 3), 170, np.uint8)
    if desk_in_photo:
        view[:, round(1000 * view.shape[1] / mosaic.shape[1]) :] = (150, 110, 70)
    crop = find_page_crop(mosaic, PageCells(cells.seen, cells.paper, (view,)))
    if desk_in_photo:
        assert len(crop.edges) == 1
        assert 994 < crop.right < 1003
    else:
        assert crop.right > 1100
    assert (crop.left, crop.top, crop.bottom) == (0, 0, 1560)


def test_what_photos_show_of_the_sheet_is_in_their_own_light() -> None:
    page = page_image()
    upper, lower = page[:900], (page[700:] * 0.4).astype(np.uint8)
    placed = [place(upper, translation(0, 0)), place(lower, translation(0, 700), 1)]
    cells = see_sheet(placed, 1000, 1560)
    assert cells.seen.all()
    # Rows of 600 in which the photos show all of the page, or nothing.
    shown = np.array([view.max(axis=(1, 2)) > 0 for view in cells.views])
    assert shown[0, :340].all()
    assert shown[1, 275:].all()
    assert not shown[0, 350:].any()
    assert not shown[1, :265].any()
    assert [np.median(view[view > 0]) for view in cells.views] == [255, 102]
