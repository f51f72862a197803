"""One page is chosen where the photo shows two; columns and tables stay together."""

from functools import cache

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services.contract.rectify import RectifyParameters
from services.rectify.analysis.page_analysis import analyse_photo
from services.rectify.analysis.page_choice import PageChoice, choose_page
from services.rectify.effort import BRIEF
from services.rectify.pipeline import rectify
from services.texture_flow.field import FlowSamples
from simulation.degradation import PHONE, degrade, desk_texture
from simulation.flat_page import Page
from simulation.pages import own_pages
from simulation.photo import simulate_photo
from simulation.scenes import BOOK, PLANE, POSES, View, photograph
from simulation.surfaces import Cylinder, Plane
from simulation.truth import Truth
from tests.counts import some
from tests.services.scenes import Album, Shot

pytestmark = pytest.mark.pipeline

Rgb = NDArray[np.uint8]
Mask = NDArray[np.bool_]
SIZE = (640, 820)
"""Of the photo of each page of a spread."""


@cache
def single(number: int, view: View, shape: Plane | Cylinder) -> tuple[Rgb, Mask]:
    """A page alone on black, and where it is."""
    photo = photograph(own_pages(480, 750)[number], view, 0.0, shape, size=SIZE)
    return photo.image, photo.truth.page_mask()


@cache
def spread(
    left: int, right: int, views: tuple[View, View], shape: Plane | Cylinder = PLANE
) -> tuple[Rgb, Mask]:
    """Two pages on a desk that meet in a gutter, and where the left one is.

    The left page lies on the right one's margin and casts a soft shadow there; each leans its own way.
    """
    (first, first_mask), (second, second_mask) = single(left, views[0], shape), single(right, views[1], PLANE)
    width, height = 2 * SIZE[0] + 100, SIZE[1] + 80
    photo = np.asarray(0.6 * desk_texture(width, height, np.random.default_rng(2)), np.uint8)
    # Rows that cross both pages tell how far the right one goes under the left one.
    rows = np.flatnonzero(np.minimum(first_mask.sum(axis=1), second_mask.sum(axis=1)) > 0.5 * SIZE[0])
    ends = SIZE[0] - first_mask[rows, ::-1].argmax(axis=1)
    shift = int(np.percentile(ends - second_mask[rows].argmax(axis=1), 10))
    window = (slice(40, 40 + SIZE[1]), slice(40 + shift, 40 + shift + SIZE[0]))
    photo[window][second_mask] = second[second_mask]
    whole = np.zeros((height, width), bool)
    whole[40 : 40 + SIZE[1], 40 : 40 + SIZE[0]] = first_mask
    away = cv2.distanceTransform(np.asarray(~whole, np.uint8), cv2.DIST_L2, 5)
    photo[:] = photo * (1 - 0.5 * np.exp(-away / 20.0))[..., None]
    photo[whole] = first_of(first, whole.shape)[whole]
    return photo, whole


def first_of(image: Rgb, shape: tuple[int, ...]) -> Rgb:
    """The left page's picture on the canvas of the spread."""
    canvas = np.zeros((*shape, 3), np.uint8)
    canvas[40 : 40 + SIZE[1], 40 : 40 + SIZE[0]] = image
    return canvas


def choice_of(shot: Shot) -> PageChoice:
    """What is chosen of the characters that the analysis kept."""
    a = shot.analysis
    boxes = a.text.components.boxes[:, 2:] / a.factor
    return choose_page(shot.photo.image, a.characters, boxes, a.text_height_px, a.major, a.minor, a.paper)


LEANING = (View("left", 2500.0, 26.0, 180.0, 0.5), View("right", 2500.0, 26.0, 0.0, 1.0))
"""Of an opened book, seen from above its gutter."""
FRONTAL = (View("left", 2500.0, 0.0, 0.0, 0.0), View("right", 2500.0, 0.0, 0.0, 0.5))


@pytest.mark.long
@pytest.mark.parametrize("shape", some(1, [BOOK, PLANE]))
def test_the_text_of_a_facing_page_is_left_out(shape: Plane | Cylinder) -> None:
    photo, left = spread(0, 3, LEANING, shape)
    # The right page is cut off by the end of the photo.
    seen = np.ascontiguousarray(photo[:, : 40 + SIZE[0] + 270])
    analysis = analyse_photo(seen)
    at = np.round(analysis.characters).astype(int)
    assert analysis.facing_page
    assert left[at[:, 1], at[:, 0]].mean() > 0.995
    letters = sum(len(word.text) for line in own_pages(480, 750)[0].lines for word in line)
    assert len(at) > 0.55 * letters  # those that touch are counted as one


def test_of_two_whole_pages_one_is_shown_and_the_answer_says_so() -> None:
    photo, left = spread(0, 3, LEANING)
    result = rectify(photo, RectifyParameters(upright=False))
    assert "facing-page" in [notice.code for notice in result.warnings]
    at = np.round(result.mesh[8:-8, 6:-6].reshape(-1, 2)).astype(int)
    inside = ((at >= 0) & (at < [left.shape[1], left.shape[0]])).all(axis=1)
    on_left = left[at[inside, 1], at[inside, 0]].mean()
    assert on_left < 0.02 or on_left > 0.98


@pytest.mark.parametrize("shape", [PLANE, BOOK])
def test_a_preview_by_text_shows_one_of_two_pages(shape: Plane | Cylinder) -> None:
    photo, left = spread(0, 3, LEANING, shape)
    seen = np.ascontiguousarray(photo[:, : 40 + SIZE[0] + 270])
    result = rectify(seen, RectifyParameters(upright=False), effort=BRIEF)
    assert result.evidence.source == ("text",)
    assert "facing-page" in [notice.code for notice in result.warnings]
    at = np.round(result.mesh[4:-4, 4:-4].reshape(-1, 2)).astype(int)
    inside = ((at >= 0) & (at < [seen.shape[1], left.shape[0]])).all(axis=1)
    on_left = left[at[inside, 1], at[inside, 0]].mean()
    assert on_left < 0.02 or on_left > 0.98, "half of the nodes were on either page"


def test_a_strip_of_a_facing_page_in_the_same_direction_is_left_out() -> None:
    photo, left = spread(0, 3, FRONTAL)
    analysis = analyse_photo(np.ascontiguousarray(photo[:, : 40 + SIZE[0] + 130]))
    at = np.round(analysis.characters).astype(int)
    assert analysis.facing_page
    assert left[at[:, 1], at[:, 0]].mean() > 0.995


def test_a_region_is_taken_at_its_word() -> None:
    photo, left = spread(0, 3, LEANING)
    height, width = photo.shape[:2]
    region = ((0.0, 0.0), (width - 1.0, 0.0), (width - 1.0, height - 1.0), (0.0, height - 1.0))
    analysis = analyse_photo(photo, region)
    at = np.round(analysis.characters).astype(int)
    assert not analysis.facing_page
    assert 0.2 < left[at[:, 1], at[:, 0]].mean() < 0.8


@pytest.mark.parametrize("name", ["picture", "columns", "book"])
def test_one_page_stays_whole(album: Album, name: str) -> None:
    assert not album[name].analysis.facing_page
    assert choice_of(album[name]).kept.all()


@pytest.mark.parametrize("drawing", ["rule", "tint"])
def test_columns_stay_together(album: Album, drawing: str) -> None:
    page = album.pages()[4]
    image = page.image.reshape(page.height, page.width).copy()
    if drawing == "tint":
        image[:, page.width // 2 :] = 0.8 * image[:, page.width // 2 :]
    else:
        cv2.line(image, (page.width // 2, 30), (page.width // 2, page.height - 30), 60, 3)
    photo = photograph(Page(image, page.lines), POSES[0], 0.1, size=(1050, 1350))
    analysis = analyse_photo(photo.image)
    assert not analysis.facing_page
    words = photo.truth.text_points(np.random.default_rng(1))
    middle = np.median(words[:, 0])
    assert 0.35 < (analysis.characters[:, 0] < middle).mean() < 0.65


VALLEY, RIDGE = Cylinder((0.0, 0.0, 0.75, 0.0, -0.35)), Cylinder((0.0, 0.0, -1.3, 0.0, 1.5, 0.0, -0.7))
"""Pages that bend strongly between their two columns."""
ABOVE, BELOW = View("above", 2000.0, 25.0, 262.0, -4.0), View("below", 2300.0, 22.0, 90.0, 3.0)


@pytest.mark.long
@pytest.mark.parametrize(
    ("shape", "view", "dark_side"),
    some(1, [(VALLEY, ABOVE, 1.0), (VALLEY, BELOW, -1.0), (RIDGE, BELOW, 1.0)]),
)
def test_columns_of_a_page_that_bends_between_them_stay_together(
    shape: Cylinder, view: View, dark_side: float
) -> None:
    # A shadow ends in the gutter: a long edge, at which the lines change their direction.
    photo, truth = bent_columns(shape, view)
    sheet = truth.sheet_lattice().upsampled(0, truth.camera.height)
    ramp = np.clip(np.nan_to_num(dark_side * sheet[..., 0] / 0.04) + 0.5, 0, 1)
    shaded = (photo * (1 - 0.35 * ramp)[..., None]).astype(np.uint8)
    analysis = analyse_photo(degrade(shaded, PHONE, np.random.default_rng(3)))
    assert not analysis.facing_page
    on_left = truth.photo_to_page(analysis.characters)[:, 0] < truth.page.width / 2
    assert 0.4 < on_left.mean() < 0.6


@cache
def bent_columns(shape: Cylinder, view: View) -> tuple[Rgb, Truth]:
    """A page of two columns on a desk, and its truth."""
    page, camera = own_pages(640, 1000)[4], view.camera(840, 1080)
    desk = desk_texture(camera.width, camera.height, np.random.default_rng(3))
    photo = simulate_photo(page, shape, 0.0, view.pose(page, shape, camera), camera, background=desk)
    return photo.image, photo.truth


def test_grain_of_a_desk_that_looks_like_print_is_left_out(album: Album) -> None:
    shot = album["plain"]
    a, mask = shot.analysis, shot.truth.page_mask()
    beside = np.argwhere(~mask[:, : mask.shape[1] // 2])[::3001, ::-1].astype(np.float64)
    stray = beside[beside[:, 0] < np.percentile(a.characters[:, 0], 1)][:40]
    assert len(stray) > 0.006 * len(a.characters)
    everything = np.concatenate([a.characters, stray])
    boxes = np.full(everything.shape, a.text_height_px)
    choice = choose_page(shot.photo.image, everything, boxes, a.text_height_px, a.major, a.minor, a.paper)
    assert not choice.facing_page
    assert choice.kept[: len(a.characters)].all()
    assert choice.kept[len(a.characters) :].mean() < 0.3


def test_grain_beside_a_receipt_is_no_facing_page(album: Album) -> None:
    # A quarter of what looks like print: strokes along the grain, upright, on one side of the sheet.
    shot = album["plain"]
    a, mask = shot.analysis, shot.truth.page_mask()
    far = cv2.distanceTransform(np.asarray(~mask, np.uint8), cv2.DIST_L2, 5) > 2 * a.text_height_px
    left, top, bottom = (int(np.percentile(a.characters[:, k], p)) for k, p in ((0, 1), (1, 5), (1, 95)))
    beside = np.argwhere(far[top:bottom, :left])[:, ::-1] + (0.0, top)
    stray = np.random.default_rng(1).permutation(beside)[: len(a.characters) // 3]
    everything = np.concatenate([a.characters, stray])
    boxes = np.concatenate([a.text.components.boxes[:, 2:] / a.factor, np.full(stray.shape, [3.0, 12.0])])
    along = (np.full(len(stray), np.pi / 2), np.ones(len(stray)))
    flow = zip((a.major.points, a.major.angles, a.major.weights), (stray, *along), strict=True)
    major = FlowSamples(*map(np.concatenate, flow))
    choice = choose_page(shot.photo.image, everything, boxes, a.text_height_px, major, a.minor, a.paper)
    assert len(stray) > 0.2 * len(a.characters)
    assert not choice.facing_page
    assert choice.kept[: len(a.characters)].all()
    assert choice.kept[len(a.characters) :].mean() < 0.1
