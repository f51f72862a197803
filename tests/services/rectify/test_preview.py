"""A preview agrees with the true page, from its sides or from its text, and speaks of the whole photo's pixels."""

from typing import NamedTuple

import cv2
import numpy as np
import pytest

from services.contract.rectify import PageKind, RectifyParameters
from services.errors import NoText
from services.rectify.effort import BRIEF
from services.rectify.pipeline import rectify
from services.rectify.preview_scale import enlarge, reduce_parameters
from services.rectify.results import RectifyResult
from services.rectify.shape_choice.brief_choice import SEEMS_CURVED, line_direction
from services.sheet.surfaces import StripsSurface
from simulation.degradation import Degradation
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto, simulate_photo
from simulation.scenes import BOOK, PLANE, POSES, WAVE, photograph
from simulation.surfaces import Shape
from tests.services.rectify.test_pipeline import mesh_residual

SIZE = (630, 810)
AS_IT_LIES = RectifyParameters(upright=False)


def shot(shape: Shape, *, desk: bool) -> SimulatedPhoto:
    dirt = Degradation(noise_sigma=2.0) if desk else None
    page = own_pages(800, 1250)[1]
    return photograph(page, POSES[3], 0.0, shape, size=SIZE, dirt=dirt, rng=np.random.default_rng(1))


@pytest.fixture(scope="module")
def planar() -> tuple[SimulatedPhoto, RectifyResult]:
    photo = shot(PLANE, desk=True)
    return photo, rectify(photo.image, AS_IT_LIES, effort=BRIEF)


def test_the_sides_of_a_sheet_show_where_it_lies(planar: tuple[SimulatedPhoto, RectifyResult]) -> None:
    photo, result = planar
    assert result.evidence.source == ("outline",)
    assert mesh_residual(result, photo) < 0.005
    assert result.corners is not None
    assert not result.image.strides[0], "nothing is drawn"


def test_text_alone_shows_where_a_plane_lies(planar: tuple[SimulatedPhoto, RectifyResult]) -> None:
    photo = planar[0]
    corners = photo.truth.page_to_photo(
        np.array([[150.0, 150.0], [650.0, 150.0], [650.0, 1100.0], [150.0, 1100.0]])
    )
    region = tuple((float(x), float(y)) for x, y in corners)
    result = rectify(photo.image, RectifyParameters(upright=False, region=region), effort=BRIEF)
    assert result.evidence.source == ("text",)
    assert mesh_residual(result, photo) < 0.02


def test_a_bent_sheet_is_a_mesh_between_its_sides() -> None:
    photo = shot(BOOK, desk=True)
    result = rectify(photo.image, AS_IT_LIES, effort=BRIEF)
    assert result.kind == "curved"
    assert mesh_residual(result, photo) < 0.005, "a plane leaves 0.1"


class Bent(NamedTuple):
    """A photo of a bent sheet, its preview, and the errors allowed: of the mesh, and over that of a plane."""

    photo: SimulatedPhoto
    result: RectifyResult
    largest: float
    share_of_plane: float


# Bends along the lines show by strokes alone. In a small photo these leave 0.015 to 0.033, by where their blocks lie.
@pytest.fixture(
    scope="module", params=[(WAVE, 0.0, 0.02, 0.5), (BOOK, np.pi / 2, 0.035, 0.75)], ids=["across", "along"]
)
def bent(request: pytest.FixtureRequest) -> Bent:
    """A sheet that is bent, its rulings across or along the lines of text; its sides are out of view."""
    page, view, (shape, skew_rad, *allowed) = own_pages(800, 1250)[1], POSES[3], request.param
    camera = view.camera(840, 1080)
    pose = view.pose(page, shape, camera, margin=-0.06)
    photo = simulate_photo(page, shape, skew_rad, pose, camera)
    # Rulings along straight lines leave the directions of text nearly those of a plane, so they are demanded.
    kind: PageKind = "auto" if skew_rad == 0.0 else "curved"
    return Bent(
        photo, rectify(photo.image, RectifyParameters(upright=False, kind=kind), effort=BRIEF), *allowed
    )


def test_text_alone_shows_how_a_sheet_is_bent(bent: Bent) -> None:
    photo, result = bent.photo, bent.result
    assert (result.kind, result.evidence.source) == ("curved", ("text",))
    assert isinstance(result.surface, StripsSurface)
    assert SEEMS_CURVED not in result.warnings
    plane = rectify(photo.image, RectifyParameters(upright=False, kind="planar"), effort=BRIEF)
    assert plane.kind == "planar"
    assert mesh_residual(plane, photo) > 0.015
    assert mesh_residual(result, photo) < min(bent.largest, bent.share_of_plane * mesh_residual(plane, photo))


def test_a_flat_page_is_not_bent(planar: tuple[SimulatedPhoto, RectifyResult]) -> None:
    region = tuple((float(x), float(y)) for x, y in planar[1].mesh[[3, 3, -4, -4], [3, -4, -4, 3]])
    result = rectify(
        planar[0].image, RectifyParameters(upright=False, region=region, kind="curved"), effort=BRIEF
    )
    assert mesh_residual(result, planar[0]) < 0.02, "also where a bent sheet is demanded"


def test_rulings_grow_with_the_photo(bent: Bent) -> None:
    small = bent.result.surface
    large = enlarge(bent.result, 2).surface
    assert isinstance(small, StripsSurface)
    assert isinstance(large, StripsSurface)
    np.testing.assert_allclose(large.points + 0.5, 2 * (small.points + 0.5))
    np.testing.assert_allclose(large.angles_rad, small.angles_rad)
    # The direction from a point to its vanishing point stays that of the ruling.
    way = large.vanishing_points[:, :2] - large.points * large.vanishing_points[:, 2:]
    turned = np.sin(np.arctan2(way[:, 1], way[:, 0]) - large.angles_rad)
    np.testing.assert_allclose(turned, 0.0, atol=1e-6)


def test_all_lengths_grow_with_the_photo(planar: tuple[SimulatedPhoto, RectifyResult]) -> None:
    result = planar[1]
    large = enlarge(result, 2)
    assert large.image.shape == (2 * result.image.shape[0], 2 * result.image.shape[1], 3)
    np.testing.assert_allclose(large.mesh + 0.5, 2 * (result.mesh + 0.5))
    assert large.corners is not None
    assert result.corners is not None
    np.testing.assert_allclose(large.corners + 0.5, 2 * (result.corners + 0.5))
    assert large.camera.focal_length_px == pytest.approx(2 * (result.camera.focal_length_px or 0))
    assert large.print is not None
    assert result.print is not None
    np.testing.assert_allclose(large.print.heights_px, 2 * result.print.heights_px)
    asked = RectifyParameters(focal_length_px=3000.0, region=((9.5, 19.5), (99.5, 19.5), (9.5, 99.5)))
    small = reduce_parameters(asked, 2)
    assert small.focal_length_px == 1500.0
    assert small.region == ((4.5, 9.5), (49.5, 9.5), (4.5, 49.5))


@pytest.mark.parametrize("turn_rad", [0.0, 0.5, 1.6, 2.8])
def test_neighbours_lie_along_the_lines(turn_rad: float) -> None:
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(30) * 6.0, np.arange(20) * 16.0)
    grid = np.column_stack([x.ravel(), y.ravel()]) + rng.normal(0, 0.4, (600, 2))
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    found = line_direction(grid @ np.array([[c, s], [-s, c]]))
    assert abs(np.sin(found - turn_rad)) < np.sin(np.radians(6))


def test_a_photo_of_nothing_is_refused() -> None:
    blank = cv2.GaussianBlur(np.random.default_rng(2).integers(90, 110, (400, 300, 3), np.uint8), (0, 0), 5)
    with pytest.raises(NoText):
        rectify(np.asarray(blank, np.uint8), AS_IT_LIES, effort=BRIEF)
