"""Both pages of an opened book: in reading order, each flat, with one camera."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from services.contract.rectify import RectifyParameters
from services.notices import Notice
from services.rectify.analysis.page_analysis import analyse_spread
from services.rectify.pipeline import rectify
from services.rectify.spread import RectifiedPages, reading_order, rectify_spread, turn_like, turn_result
from simulation.degradation import PHONE
from simulation.pages import own_pages
from simulation.scenes import View
from simulation.spread import SimulatedSpread, page_beside_gutter, photograph_spread
from simulation.truth import Truth
from tests.services.scenes import Album

pytestmark = pytest.mark.pipeline

BOTH = RectifyParameters(upright=False, pages="both")


@cache
def opened_book() -> SimulatedSpread:
    """Two pages in a photo of 1.5 megapixels."""
    pages = own_pages(640, 1000)
    shapes = (page_beside_gutter(0.7, 0.1, right=False), page_beside_gutter(0.5, 0.15, right=True))
    view = View("book", 2400.0, 14.0, 80.0, 2.0)
    rng = np.random.default_rng(8)
    return photograph_spread((pages[0], pages[3]), view, shapes, dirt=PHONE, rng=rng, size=(1440, 1060))


@cache
def flat_pages() -> RectifiedPages:
    """Its flat views."""
    return rectify_spread(opened_book().image, BOTH)


def residual_percent(mesh: np.ndarray, truth: Truth) -> float:
    """RMS of the mesh's inner nodes after the best similarity, per cent of the page's width."""
    rows, columns = mesh.shape[:2]
    flat = np.stack(np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows)), axis=-1)
    page = truth.photo_to_page(mesh.reshape(-1, 2)).reshape(mesh.shape)
    size = np.array([truth.page.width, truth.page.height])
    inside = (np.abs(page / size - 0.5) < 0.45).all(axis=-1)
    aim = page[inside]
    # Pixels of the view are square, but its size is not known here: scales across and down are fitted, one each.
    found = np.column_stack([flat[inside], np.ones(inside.sum())])
    fitted = found @ np.linalg.lstsq(found, aim, rcond=None)[0]
    return 100 * float(np.sqrt(((fitted - aim) ** 2).sum(axis=1).mean())) / truth.page.width


def test_the_left_page_comes_first_and_both_are_flat() -> None:
    spread, found = opened_book(), flat_pages()
    assert len(found.pages) == 2
    assert found.warnings == ()
    for result, truth, other in zip(
        found.pages, (spread.left, spread.right), (spread.right, spread.left), strict=True
    ):
        inner = result.mesh[6:-6, 4:-4].reshape(-1, 2)
        assert truth.on_page(inner).mean() > 0.97
        assert other.on_page(result.mesh.reshape(-1, 2)).mean() < 0.04
        assert residual_percent(result.mesh, truth) < 1.0
        assert "facing-page" not in [notice.code for notice in result.warnings]


def test_both_pages_have_one_camera() -> None:
    focal_lengths = [page.camera.focal_length_px or 0.0 for page in flat_pages().pages]
    assert focal_lengths[0] == pytest.approx(focal_lengths[1], rel=0.06)
    assert np.mean(focal_lengths) == pytest.approx(opened_book().left.focal_length_px, rel=0.12)


def test_a_page_holds_nothing_of_the_other_ones_text() -> None:
    spread = opened_book()
    pages = analyse_spread(spread.image)
    on_left = [spread.left.on_page(page.characters).mean() for page in pages]
    assert sorted(on_left) == pytest.approx([0.0, 1.0], abs=0.005)
    assert all(page.gutter is not None for page in pages)


def test_a_flat_scan_of_two_pages_is_two_flat_pages_each_level() -> None:
    left, right = (page.image for page in own_pages(640, 900)[:4:3])
    scan = np.full((940, 1400, 3), 255, np.uint8)
    angles_deg = (-0.5, 2.5)
    for page, x, angle_deg in zip((left, right), (30, 720), angles_deg, strict=True):
        size = (page.shape[1], page.shape[0])
        turn = cv2.getRotationMatrix2D((size[0] / 2, size[1] / 2), angle_deg, 1.0)
        turned = cv2.warpAffine(page, turn, size, flags=cv2.INTER_AREA, borderValue=255)[..., None]
        scan[20:920, x : x + 640] = np.minimum(scan[20:920, x : x + 640], turned)
    found = rectify_spread(scan, BOTH)
    assert found.warnings == ()
    assert [page.kind for page in found.pages] == ["planar", "planar"]
    for result, middle, angle_deg in zip(found.pages, (350, 1040), angles_deg, strict=True):
        assert result.mesh.mean(axis=(0, 1)) == pytest.approx((middle, 470), abs=60)
        assert -np.degrees(direction_of(result.mesh)) == pytest.approx(angle_deg, abs=0.2)
        # A mere turn: cells are squares of one size.
        sizes = np.linalg.norm(np.diff(result.mesh, axis=1), axis=2)
        assert np.ptp(sizes) < 0.01 * sizes.mean()


def direction_of(mesh: np.ndarray) -> float:
    """Direction (rad) of the view's rows in the photo."""
    x, y = (mesh[:, -1] - mesh[:, 0]).mean(axis=0)
    return float(np.arctan2(y, x))


def test_one_page_is_answered_as_one_with_a_word_on_it(album: Album) -> None:
    shot = album["columns"]
    found = rectify_spread(shot.photo.image, BOTH)
    assert len(found.pages) == 1
    assert [notice.code for notice in found.warnings] == ["one-page"]


@pytest.mark.parametrize(
    ("direction", "expected"), [((1.0, 0.1), [1, 0]), ((-1.0, 0.0), [0, 1]), ((0.1, 1.0), [0, 1])]
)
def test_reading_order_follows_the_lines(direction: tuple[float, float], expected: list[int]) -> None:
    places = [np.array([500.0, 100.0]), np.array([100.0, 300.0])]
    assert reading_order(places, np.array(direction)) == expected


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_turned_view_shows_the_same(turns: int) -> None:
    result = flat_pages().pages[0]
    turned = turn_result(result, turns)
    assert turned.orientation.rotation_deg == 90 * turns
    height, width = turned.image.shape[:2]
    # The pixel at the middle of the right half shows what the mesh says of it.
    old = np.rot90(result.image, -turns)
    assert np.array_equal(turned.image[height // 2, 3 * width // 4], old[height // 2, 3 * width // 4])
    corners = [result.mesh[0, 0], result.mesh[0, -1], result.mesh[-1, -1], result.mesh[-1, 0]]
    assert np.array_equal(turned.mesh[0, 0], corners[-turns])
    assert np.array_equal(turned.mesh[0, -1], corners[(1 - turns) % 4])


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_page_that_could_not_be_read_is_turned_like_the_other_one(turns: int) -> None:
    left, right = flat_pages().pages
    sure = replace(left, orientation=replace(left.orientation, confidence=0.9))
    unread = replace(turn_result(right, turns), warnings=(Notice("orientation-unknown", "Not turned."),))
    found = turn_like(unread, [sure, unread])
    assert np.array_equal(found.mesh, right.mesh)
    assert np.array_equal(found.image, right.image)
    assert found.warnings == ()
    # Nobody knows better: it stays.
    assert turn_like(unread, [left, unread]) is unread


@cache
def letters_side_by_side() -> np.ndarray:
    """Two flat pages on a desk, the right one turned by six degrees."""
    photo = np.full((1000, 1500, 3), (92, 70, 52), np.uint8)
    for page, turn, left in zip(own_pages(480, 680)[:2], (0.0, 6.0), (130, 860), strict=True):
        place = cv2.getRotationMatrix2D((240, 340), turn, 1.0)
        place[:, 2] += (left, 150)
        image = cv2.cvtColor(page.image, cv2.COLOR_GRAY2RGB) if page.image.ndim == 2 else page.image
        drawn = cv2.warpAffine(image, place, (1500, 1000), flags=cv2.INTER_AREA)
        shown = cv2.warpAffine(np.full(image.shape[:2], 255, np.uint8), place, (1500, 1000))
        photo[shown > 127] = drawn[shown > 127]
    return photo


def test_of_sheets_side_by_side_one_is_flattened_and_the_other_named() -> None:
    result = rectify(letters_side_by_side(), replace(BOTH, pages="main"))
    assert "facing-page" in [notice.code for notice in result.warnings]
    assert result.kind == "planar"
    assert result.image.shape[1] / result.image.shape[0] == pytest.approx(480 / 680, rel=0.02)


def test_sheets_side_by_side_are_both_given() -> None:
    found = rectify_spread(letters_side_by_side(), BOTH)
    assert found.warnings == ()
    aspects = [page.image.shape[1] / page.image.shape[0] for page in found.pages]
    assert aspects == pytest.approx([480 / 680] * 2, rel=0.02)
