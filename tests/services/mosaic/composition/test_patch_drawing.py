"""A photo's patch is drawn where it belongs, sharp, and only where the photo shows the page."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from services.arrays import Points
from services.geometry.homographies import scaling, transform_points, translation
from services.mosaic.composition.patch_drawing import (
    DrawablePatch,
    PatchMap,
    Rectangle,
    draw_patch,
    map_patch,
    prepare_patch,
)
from services.mosaic.flat_photo import RIM_PX
from services.mosaic.light.tones import ToneMap
from services.mosaic.placing.placement import DisplacementField, Placement
from services.sheet.plane.framing import FlatFrame
from tests.services.mosaic.cuttings import Box, cut, in_color, place, prose

pytestmark = pytest.mark.pipeline

WIDTH, HEIGHT = 1000, 700
H_PHOTO_MOSAIC = np.array([[1.05, 0.08, -60.0], [-0.05, 1.1, -20.0], [8e-5, -5e-5, 1.0]])


def mapped(patch: DrawablePatch, rectangle: Rectangle) -> PatchMap:
    found = map_patch(patch, rectangle)
    assert found is not None
    return found


def projected() -> DrawablePatch:
    page = in_color(prose().image)
    photo = np.asarray(cv2.warpPerspective(page, H_PHOTO_MOSAIC, (900, 650), flags=cv2.INTER_CUBIC), np.uint8)
    return prepare_patch(place(photo, np.linalg.inv(H_PHOTO_MOSAIC)), WIDTH, HEIGHT)


def test_the_page_comes_back_where_the_photo_shows_it() -> None:
    page, patch = in_color(prose().image), projected()
    found = mapped(patch, Rectangle(0, 0, WIDTH, HEIGHT))
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    seen = transform_points(H_PHOTO_MOSAIC, np.stack([x, y], axis=-1).reshape(-1, 2).astype(float))

    def inside(rim: float) -> np.ndarray:
        return ((seen >= rim) & (seen <= np.array([899, 649]) - rim)).all(axis=1).reshape(HEIGHT, WIDTH)

    covered = found.covered > 0
    assert (inside(RIM_PX + 0.1) <= covered).all()
    assert (covered <= inside(RIM_PX - 0.1)).all()
    difference = np.abs(draw_patch(patch, found).astype(int) - page)[covered]
    # Two cubic interpolations of sharp letters; a displacement of a quarter of a pixel makes 8.
    assert difference.mean() < 2.5
    box = patch.box
    rows, columns = np.nonzero(covered)
    assert box.left <= columns.min()
    assert columns.max() < box.right
    assert box.top <= rows.min()
    assert rows.max() < box.bottom


def test_rectangles_fit_together() -> None:
    patch = projected()
    whole = mapped(patch, Rectangle(0, 0, WIDTH, HEIGHT))
    drawn = draw_patch(patch, whole).astype(int)
    part = Rectangle(333, 211, 301, 155)
    found = mapped(patch, part)
    at = part.within(Rectangle(0, 0, WIDTH, HEIGHT))
    assert np.abs(draw_patch(patch, found) - drawn[at])[found.covered > 0].max() <= 12
    assert (found.covered != whole.covered[at]).mean() < 1e-3


def test_a_rectangle_beside_the_photo_is_none() -> None:
    patch = prepare_patch(cut(in_color(prose().image), Box(100, 100, 300, 300)), WIDTH, HEIGHT)
    assert patch.box == Rectangle(100, 100, 200, 200)
    assert map_patch(patch, Rectangle(500, 400, 64, 64)) is None


def test_more_detail_than_the_mosaic_has_does_not_alias() -> None:
    stripes = np.zeros((600, 900, 3), np.uint8)
    stripes[:, ::2] = 200
    patch = prepare_patch(place(stripes, scaling(0.35)), 315, 210)
    assert patch.factor == pytest.approx(0.35, rel=1e-3)
    found = mapped(patch, Rectangle(0, 0, 315, 210))
    drawn = draw_patch(patch, found)[found.covered > 0]
    assert np.abs(drawn.astype(int) - 100).max() < 30
    # The box of 2.9 pixels leaves a sixth of the stripes; stepping over them would leave them whole.
    assert drawn.std() < 20
    as_it_is = prepare_patch(place(stripes, scaling(0.9)), 810, 540)
    assert as_it_is.factor == 1.0


def test_only_what_the_view_shows_is_covered() -> None:
    placed = cut(in_color(prose().image), Box(0, 0, 600, 500))
    ends = replace(placed.flat, frame=FlatFrame(np.eye(3), 400, 500), shown=placed.flat.shown[:, :400])
    patch = prepare_patch(replace(placed, flat=ends), WIDTH, HEIGHT)
    covered = mapped(patch, Rectangle(0, 0, WIDTH, HEIGHT)).covered > 0
    assert covered[3:490, 3:399].all()
    assert not covered[:, 401:].any()
    nothing = replace(placed, flat=replace(placed.flat, shown=np.zeros_like(placed.flat.shown)))
    assert prepare_patch(nothing, WIDTH, HEIGHT).box.width == 0


@dataclass(frozen=True, slots=True)
class Torn:
    """A flat page whose model ends at x = 300."""

    width: int
    height: int

    def to_photo(self, pixels: Points) -> Points:
        return np.where(pixels[:, :1] > 300, np.nan, pixels)

    def through(self, H_old_new: np.ndarray, width: int, height: int) -> "Torn":
        raise AssertionError


def test_nothing_is_drawn_where_the_surface_is_unknown() -> None:
    placed = cut(in_color(prose().image), Box(0, 0, 600, 500))
    patch = prepare_patch(replace(placed, flat=replace(placed.flat, frame=Torn(600, 500))), WIDTH, HEIGHT)
    covered = mapped(patch, Rectangle(0, 0, WIDTH, HEIGHT)).covered > 0
    assert not covered[:, 301:].any()
    assert covered[3:480, 3:260].all()


def test_displacements_are_followed() -> None:
    page = in_color(prose().image)
    placed = cut(page, Box(0, 0, 800, 600))
    nodes = np.full((3, 3, 2), 4.0)
    moved = replace(placed, placement=Placement(translation(0, 0), DisplacementField(nodes, 800, 600)))
    found = mapped(prepare_patch(moved, WIDTH, HEIGHT), Rectangle(50, 50, 400, 300))
    drawn = draw_patch(prepare_patch(moved, WIDTH, HEIGHT), found)
    assert np.abs(drawn.astype(int) - page[46:346, 46:446]).max() <= 1


def test_tones_are_those_of_the_flat_view() -> None:
    placed = cut(in_color(np.full((400, 400), 200, np.uint8)), Box(0, 0, 400, 400))
    coefficients = np.zeros((1, 2, 6), np.float32)
    coefficients[0, 0] = [1, 1, 1, 1, 0, 0]
    coefficients[0, 1] = [0.5, 0.5, 0.5, 1, 0, 0]
    toned = replace(placed, tones=ToneMap(coefficients, 400, 400), placement=Placement(translation(50, 0)))
    patch = prepare_patch(toned, 500, 400)
    found = mapped(patch, Rectangle(0, 0, 500, 400))
    drawn, plain = draw_patch(patch, found), placed.flat.photo[0, 0].astype(int)
    assert np.abs(drawn[200, 60] - plain).max() <= 1
    assert np.abs(drawn[200, 440] - plain // 2).max() <= 1
    assert np.abs(drawn[200, 250] - plain * 3 // 4).max() <= 2


def test_a_frame_is_seen_through() -> None:
    """Flat pixels need not be photo pixels."""
    page = in_color(prose().image)
    placed = cut(page, Box(0, 0, 1000, 700))
    half = FlatFrame(scaling(2.0), 500, 350)
    flat = replace(placed.flat, frame=half, shown=np.ones((350, 500), bool))
    patch = prepare_patch(replace(placed, flat=flat, placement=Placement(scaling(2.0))), WIDTH, HEIGHT)
    found = mapped(patch, Rectangle(100, 100, 500, 400))
    assert np.abs(draw_patch(patch, found).astype(int) - page[100:500, 100:600]).max() <= 1


@pytest.mark.parametrize("scale", [1e-4, 300.0])
def test_a_wild_placement_costs_no_more(scale: float) -> None:
    """A photo of a pixel's size, or of which a pixel fills the page."""
    patch = prepare_patch(place(in_color(prose().image), scaling(scale)), 400, 300)
    found = map_patch(patch, Rectangle(0, 0, 400, 300))
    assert patch.source.size <= prose().image.size * 3
    assert found is None or found.covered.shape == (300, 400)
