"""Pages whose corners are given: exact, at least as good as with the outline seen, bent and without text too."""

from functools import cache
from typing import cast

import numpy as np
import pytest

from services.arrays import Points
from services.contract.rectify import Corners, RectifyParameters
from services.errors import InvalidOption
from services.operations.capture_reply import describe_quality
from services.rectify.pipeline import rectify
from services.rectify.results import RectifyResult
from simulation.degradation import PHONE
from simulation.flat_page import Page
from simulation.folded import folded_in_thirds
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto
from simulation.scenes import BOOK, PLANE
from simulation.sheets import SHEET_ASPECT, SHEET_VIEWS, Staging, photograph_sheet, with_margins
from simulation.surfaces import Shape
from tests.services.rectify.test_pipeline import mesh_residual

pytestmark = pytest.mark.pipeline

SEEN = RectifyParameters(upright=False)


def true_corners(photo: SimulatedPhoto) -> Points:
    return photo.truth.outline(50)[[0, 50, 100, 150]]


def given(corners: Points, **options: object) -> RectifyParameters:
    asked = cast(Corners, tuple((float(x), float(y)) for x, y in corners))
    return RectifyParameters(corners=(asked,), **options)  # type: ignore[arg-type]


def corners_of(result: RectifyResult) -> Points:
    return result.mesh[[0, 0, -1, -1], [0, -1, -1, 0]]


SHAPES: dict[str, Shape] = {
    "flat": PLANE,
    "bent": BOOK,
    "folded": folded_in_thirds(
        SHEET_ASPECT, 25, -20, radius=0.03, sags=(0.0, 0.0, 0.0), upright=False, skew_deg=0.0
    ),
}


@cache
def sheet_of_paper() -> Page:
    return with_margins(own_pages(800, 1250)[0])


def photo_of(shape: Shape, number: int = 2) -> SimulatedPhoto:
    sheet = sheet_of_paper()
    rng = np.random.default_rng(5)
    return photograph_sheet(
        sheet, SHEET_VIEWS[number], shape, Staging(), dirt=PHONE, rng=rng, size=(1050, 1350)
    )


@pytest.fixture(scope="module")
def flat() -> SimulatedPhoto:
    return photo_of(PLANE)


@pytest.mark.parametrize("name", SHAPES)
def test_the_views_corners_are_given_and_the_mesh_is_as_good_as_with_the_outline_seen(name: str) -> None:
    photo = photo_of(SHAPES[name])
    corners = true_corners(photo)
    result = rectify(photo.image, given(corners))
    assert np.abs(corners_of(result) - corners).max() < 1e-6
    assert np.array_equal(result.corners, corners)
    assert result.kind == ("planar" if name == "flat" else "curved")
    seen, known = mesh_residual(rectify(photo.image, SEEN), photo), mesh_residual(result, photo)
    assert known < 1.1 * seen + 0.0003
    assert known < 0.004


def test_the_first_corner_is_the_pages_top_left_and_turns_are_counted_from_it(flat: SimulatedPhoto) -> None:
    corners = true_corners(flat)
    turned = rectify(flat.image, given(np.roll(corners, 2, axis=0), rotate=(90,)))
    assert turned.orientation.rotation_deg == 90
    assert np.abs(corners_of(turned) - np.roll(corners, 3, axis=0)).max() < 1e-6
    assert turned.image.shape[1] > turned.image.shape[0]


def test_corners_that_are_off_are_not_moved_and_a_margin_shows_what_lies_around(flat: SimulatedPhoto) -> None:
    corners = true_corners(flat) + np.array([[6.0, -4.0], [-5.0, 3.0], [4.0, 5.0], [-3.0, -6.0]])
    cut = rectify(flat.image, given(corners))
    assert np.abs(corners_of(cut) - corners).max() < 1e-6
    wide = rectify(flat.image, given(corners, margin=3.0))
    edge = round(0.03 * cut.image.shape[1])
    assert wide.image.shape[1] == cut.image.shape[1] + 2 * edge
    inner = wide.image[edge:-edge, edge:-edge][40:-40, 40:-40].astype(int) - cut.image[40:-40, 40:-40]
    assert np.abs(inner).mean() < 0.5
    assert np.median(wide.image[: edge // 2]) < np.median(cut.image) - 40, "the desk, not white"


def test_without_text_the_sides_decide_and_any_four_corners_are_a_page() -> None:
    photo = np.full((600, 800, 3), 120, np.uint8)
    for corners in (
        np.array([[100.0, 80.0], [700.0, 120.0], [650.0, 520.0], [150.0, 500.0]]),
        np.array([[100.0, 80.0], [700.0, 90.0], [420.0, 180.0], [380.0, 185.0]]),
    ):
        result = rectify(photo, given(corners))
        assert np.abs(corners_of(result) - corners).max() < 1e-6
        assert result.kind == "planar"


@pytest.mark.parametrize(
    ("corners", "reason"),
    [
        ([[100, 80], [650, 520], [700, 120], [150, 500]], "cross"),
        ([[100, 80], [150, 500], [650, 520], [700, 120]], "counter-clockwise"),
        ([[100, 80], [900, 120], [650, 520], [150, 500]], "outside"),
        ([[100, 80], [101, 81], [650, 520], [150, 500]], "close"),
        ([[100, 80], [400, 80], [700, 80], [150, 500]], "not those of a sheet"),
        ([[100, 80], [700, 120], [300, 200], [150, 500]], "not those of a sheet"),
    ],
)
def test_corners_of_no_sheet_are_refused(corners: list[list[float]], reason: str) -> None:
    with pytest.raises(InvalidOption, match=reason) as refused:
        rectify(np.zeros((600, 800, 3), np.uint8), given(np.array(corners, np.float64)))
    assert refused.value.field == "corners"


def test_the_photos_quality_does_not_depend_on_the_turn(flat: SimulatedPhoto) -> None:
    found = []
    for rotate in (0, 90, 180):
        result = rectify(flat.image, RectifyParameters(upright=False, rotate=(rotate,)))
        quality = describe_quality(flat.image, result)
        assert quality is not None
        found.append((quality.line_tilt_deg, quality.predicted_character_error))
    np.testing.assert_allclose(found[1:], [found[0]] * 2, rtol=0.1, atol=0.05)
