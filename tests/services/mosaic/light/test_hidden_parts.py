"""What hides a part of one photo is found, what both photos show is not."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services.arrays import Mask
from services.geometry.homographies import translation
from services.mosaic.light.canvas import CELL_PX, Canvas, CanvasView
from services.mosaic.light.hidden_parts import HiddenPart, find_hidden_cells, hidden_part, show_only
from tests.services.mosaic.cuttings import in_color, prose

FloatImage = NDArray[np.float32]
SIDE = (480, 336)


@pytest.fixture(scope="module")
def page() -> FloatImage:
    """A page of print of the canvas's size, under even light."""
    small = cv2.resize(prose().image, SIDE, interpolation=cv2.INTER_AREA)
    return in_color(np.asarray(small, np.uint8)).astype(np.float32) * np.float32(0.85)


def view(image: FloatImage, seed: int = 0) -> CanvasView:
    """What a photo with some noise shows of the whole page."""
    noisy = image + np.random.default_rng(seed).normal(0, 2, image.shape)
    shown = np.ones(image.shape[:2], bool)
    feather = cv2.distanceTransform(np.pad(shown.astype(np.uint8), 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
    rounded = np.clip(noisy + 0.5, 0, 255).astype(np.uint8).astype(np.float32)
    return CanvasView(0, 0, rounded, shown, np.asarray(feather, np.float32))


def found(*images: FloatImage) -> tuple[Mask, ...]:
    views = [view(image, seed) for seed, image in enumerate(images)]
    return find_hidden_cells(views, [np.ones_like(image) for image in images]).of_views


def disc(x: int, y: int, radius: int, rim: float) -> FloatImage:
    """1 within a circle, 0 beyond its soft rim, (H, W, 1)."""
    columns, rows = np.meshgrid(np.arange(SIDE[0]), np.arange(SIDE[1]))
    away = np.hypot(columns - x, rows - y) - radius
    return np.clip(0.5 - away / rim, 0, 1).astype(np.float32)[..., None]


def share(cells: Mask, where: FloatImage) -> float:
    """Share of the cells within a disc."""
    inside = where[CELL_PX // 2 :: CELL_PX, CELL_PX // 2 :: CELL_PX, 0] > 0.9
    return float(cells[inside].mean())


def glare(page: FloatImage, at: FloatImage) -> FloatImage:
    return page + np.float32(300) * at


def shadow(page: FloatImage, at: FloatImage) -> FloatImage:
    return page * (1 - np.float32(0.45) * at)


def finger(page: FloatImage, at: FloatImage) -> FloatImage:
    return page + at * (np.array([190, 140, 115], np.float32) - page)


@pytest.mark.parametrize("hide", [glare, shadow, finger])
def test_of_two_photos_the_one_with_something_in_the_way_is_told(page: FloatImage, hide: object) -> None:
    at = disc(200, 150, 45, 8)
    clear, hidden = found(page, hide(page, at))  # type: ignore[operator]
    assert share(hidden, at) > 0.95
    assert hidden.mean() < 1.3 * at.mean()
    assert not clear.any()


def test_each_photo_is_told_what_it_hides(page: FloatImage) -> None:
    first, second = disc(120, 150, 40, 8), disc(350, 200, 40, 8)
    one, other = found(glare(page, first), finger(page, second))
    assert (share(one, first), share(other, second)) == pytest.approx((1, 1), abs=0.05)
    assert (share(one, second), share(other, first)) == (0, 0)


def test_the_photo_without_a_shadow_is_right_even_if_two_have_one(page: FloatImage) -> None:
    at = disc(200, 150, 45, 8)
    clear, *shaded = found(page, shadow(page, at), shadow(page, at))
    assert not clear.any()
    assert [share(each, at) > 0.95 for each in shaded] == [True, True]


def test_what_all_photos_show_is_hidden_in_none(page: FloatImage) -> None:
    at = disc(200, 150, 45, 8)
    printed = page * (1 - at * np.float32([0.2, 0.5, 0.6]))
    soft = np.asarray(cv2.GaussianBlur(printed, (0, 0), 1.2), np.float32)
    assert not any(each.any() for each in found(printed, soft))


def test_uneven_light_hides_nothing(page: FloatImage) -> None:
    """Half of the light is gone at one side, without an edge."""
    light = np.linspace(1, 0.5, SIDE[0], dtype=np.float32)[:, None]
    assert not any(each.any() for each in found(page, page * light))


def test_glare_in_all_photos_is_told_and_hidden_in_none(page: FloatImage) -> None:
    at = disc(200, 150, 45, 8)
    views = [view(glare(page, at), seed) for seed in range(2)]
    cells = find_hidden_cells(views, [np.ones_like(page)] * 2)
    assert not any(each.any() for each in cells.of_views)
    assert share(cells.clipped, disc(200, 150, 38, 1)) > 0.95
    assert cells.clipped.mean() < 1.3 * at.mean()
    overexposed = [view(np.minimum(page * 1.6, 255), seed) for seed in range(2)]
    assert not find_hidden_cells(overexposed, [np.ones_like(page)] * 2).clipped.any()


def test_white_paper_inside_a_dark_frame_is_no_glare(page: FloatImage) -> None:
    """A scan's paper is as white as glare, and a frame of print or a picture is a steep rim around it."""
    white = np.minimum(page * 1.6, 255)
    white[80:240, 100:300] = 90
    white[110:210, 130:270] = 255
    cells = find_hidden_cells([view(white, seed) for seed in range(2)], [np.ones_like(page)] * 2)
    assert not cells.clipped.any()


def test_white_paper_between_pictures_is_no_glare(page: FloatImage) -> None:
    """Pictures take the surface of the paper down, so that white paper among them seems brighter."""
    white = np.minimum(page * 1.6, 255)
    rows, columns = np.mgrid[: page.shape[0], : page.shape[1]]
    pictures = (rows < 0.7 * page.shape[0]) & (rows % 60 < 40) & (columns % 80 < 58)
    white[pictures] = 90
    white[pictures & (rows % 4 < 2) & (columns % 4 < 2)] = 20
    cells = find_hidden_cells([view(white, seed) for seed in range(2)], [np.ones_like(page)] * 2)
    assert not cells.clipped.any()


def test_one_photo_hides_nothing(page: FloatImage) -> None:
    assert [each.any() for each in found(glare(page, disc(200, 150, 45, 8)))] == [False]


def test_views_too_narrow_for_a_cell_hide_nothing(page: FloatImage) -> None:
    strip = page[:, : 2 * CELL_PX]
    cells = find_hidden_cells([view(strip), view(strip, 1)], [np.ones_like(strip)] * 2)
    assert not cells.clipped.any()
    assert not any(each.any() for each in cells.of_views)


def test_a_view_without_its_hidden_cells_ends_there(page: FloatImage) -> None:
    whole = view(page)
    hidden = np.zeros((SIDE[1] // CELL_PX, SIDE[0] // CELL_PX), bool)
    hidden[10:20, 30:40] = True
    rest = show_only(whole, hidden)
    # Two cells around them are their rim.
    assert not rest.shown[32:88, 112:168].any()
    assert rest.shown.sum() == whole.shown.sum() - 56**2
    assert rest.feather[60, 110] < 3
    assert whole.feather[60, 110] > 20
    assert show_only(whole, np.zeros_like(hidden)) is whole


def test_cells_are_found_again_on_the_mosaic() -> None:
    cells = np.zeros((12, 10), bool)
    cells[3:6, 2:5] = True
    canvas = Canvas(0.5, (100.0, 50.0), 200, 200)
    part = hidden_part(cells, np.ones_like(cells), (24, 48), canvas)
    # A cell is 8 mosaic pixels wide; the first one's corner is at (24, 48) / 0.5 from the canvas's.
    left, top = 100 + 48 - 0.5, 50 + 96 - 0.5
    assert part.fraction(left + 16, top + 24, left + 40, top + 48) == 1
    assert part.fraction(left, top, left + 80, top + 96) == pytest.approx(9 / 120)
    squares = part.over(left + 0.5, top + 0.5, 4, 20, 24)
    # With a rim of two cells, which are four squares.
    assert np.argwhere(squares).min(axis=0).tolist() == [2, 0]
    assert np.argwhere(squares).max(axis=0).tolist() == [15, 13]
    assert squares.sum() == 14 * 14
    assert HiddenPart(cells, cells, translation(0, 0)).fraction(50, 50, 60, 60) == 0
