"""Errors against analytic cases: what a similarity takes away, and what it must leave."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.common.residuals import (
    RulingErrors,
    direction_error_deg,
    field_of_view_error_deg,
    fit_similarity,
    is_upright,
    mesh_residual_percent,
    normal_error_deg,
    normals_at,
    ruling_errors,
    similarity_residual,
    strip_of,
)
from services.sheet.surfaces import PlaneSurface, StripsSurface
from simulation.camera import Camera, Pose
from simulation.flat_page import Page, PageWord
from simulation.scenes import BOOK, CONE, POSES
from simulation.surfaces import Plane, Shape
from simulation.truth import Truth

PAGE = Page(np.full((500, 320), 255, np.uint8))
TRUTH = Truth(PAGE, Plane(), 0.1, Pose(0.4, 1.0, 0.2, (0.05, 0.0, 3.6)), Camera(500.0, 420, 540))


def _square() -> np.ndarray:
    return np.stack(np.meshgrid(np.arange(10.0), np.arange(10.0)), axis=-1).reshape(-1, 2)


def _mesh(width: int, height: int, nodes: int, H_page_output: np.ndarray) -> np.ndarray:
    """Mesh of an output that shows the page by `H_page_output`, through the true forward map."""
    x, y = np.meshgrid(np.linspace(0, width - 1, nodes), np.linspace(0, height - 1, nodes))
    output = np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)])
    page = output @ H_page_output.T
    return TRUTH.page_to_photo(page[:, :2] / page[:, 2:]).reshape(nodes, nodes, 2)


def test_similarity_is_found_and_taken_away() -> None:
    source = _square()
    turn = 0.7 * np.exp(0.9j)
    moved = source @ np.array([1, 1j]) * turn + (3 - 4j)
    target = np.column_stack([moved.real, moved.imag])
    a, b = fit_similarity(source, target)
    assert abs(a - turn) < 1e-12
    assert abs(b - (3 - 4j)) < 1e-11
    assert similarity_residual(source, target) < 1e-12


def test_stretch_leaves_its_rest() -> None:
    # x stretched by 1 + e, y by 1 - e: the mean scale is 1, the rest e times the RMS radius.
    source = _square() - 4.5
    target = source * np.array([1.02, 0.98])
    radius = np.sqrt((source**2).sum(axis=1).mean())
    assert similarity_residual(source, target) == pytest.approx(0.02 * radius, rel=1e-9)


def test_mirroring_is_no_similarity() -> None:
    source = _square() - 4.5
    assert similarity_residual(source, source * np.array([-1, 1])) > 4


def test_the_true_mesh_leaves_nothing_and_is_upright() -> None:
    half = np.diag([2.0, 2.0, 1.0])
    mesh = _mesh(160, 250, 9, half)
    assert mesh_residual_percent(mesh, 160, 250, TRUTH) < 1e-9
    assert is_upright(mesh, 160, 250, TRUTH)


def test_a_wrong_aspect_is_seen_in_percent_of_the_width() -> None:
    wrong = np.diag([2.0, 2.0 * 1.01, 1.0])
    mesh = _mesh(140, 220, 9, wrong)
    residual = mesh_residual_percent(mesh, 140, 220, TRUTH)
    # About half of the 1 % goes into the scale; the rest acts on the RMS half sizes of 80 and 125 px.
    assert 0.1 < residual < 1.0


def test_few_nodes_are_interpolated() -> None:
    mesh = _mesh(160, 250, 2, np.diag([2.0, 2.0, 1.0]))
    residual = mesh_residual_percent(mesh, 160, 250, TRUTH)
    # Four nodes hold no perspective: the bilinear mesh is that far from the truth.
    assert 0.1 < residual < 10


def test_turned_and_mirrored_outputs_are_not_upright() -> None:
    upside_down = np.array([[-2.0, 0, 319], [0, -2.0, 499], [0, 0, 1]])
    mirrored = np.array([[-2.0, 0, 319], [0, 2.0, 0], [0, 0, 1]])
    for wrong in (upside_down, mirrored):
        assert not is_upright(_mesh(160, 250, 9, wrong), 160, 250, TRUTH)
    assert mesh_residual_percent(_mesh(160, 250, 9, upside_down), 160, 250, TRUTH) < 1e-9


def test_a_mesh_beside_the_page_has_no_residual() -> None:
    assert np.isnan(mesh_residual_percent(np.full((3, 3, 2), -50.0), 100, 100, TRUTH))
    assert not is_upright(np.full((3, 3, 2), -50.0), 100, 100, TRUTH)


def test_field_of_view_error_is_of_the_half_angle() -> None:
    truth = Truth(PAGE, Plane(), 0.0, Pose(), Camera(500.0, 601, 801))
    assert field_of_view_error_deg(500.0, truth) == 0
    assert field_of_view_error_deg(500.0 * np.sqrt(3.0), truth) == pytest.approx(15.0)


def test_normal_error_ignores_sign_and_length() -> None:
    truth = Truth(PAGE, Plane(), 0.0, Pose(np.radians(30.0), 0.0, 0.0), Camera(500.0, 420, 540))
    points = np.array([[209.5, 269.5], [250.0, 200.0]])
    assert normal_error_deg(np.array([[0.0, 0.0, -2.0]] * 2), truth, points) == pytest.approx(30.0)
    exact = np.array([[-0.5, 0.0, np.sqrt(0.75)]] * 2)
    assert normal_error_deg(exact, truth, points) == pytest.approx(0.0, abs=1e-5)
    assert np.isnan(normal_error_deg(exact[:0], truth, points[:0]))


def _curved_truth(shape: Shape) -> Truth:
    page = Page(np.full((500, 320), 255, np.uint8), lines=((PageWord("one", (20.0, 30.0, 300.0, 470.0)),),))
    camera = POSES[0].camera(420, 540)
    return Truth(page, shape, 0.0, POSES[0].pose(page, shape, camera), camera)


def _exact_strips(truth: Truth, strips: int = 40) -> StripsSurface:
    """What a perfect estimate would be: rulings at even steps over more than the sheet, at its head too."""
    edges = np.linspace(-1.8, 1.8, strips + 1)
    points = truth.sheet_to_photo(np.column_stack([edges, np.zeros(strips + 1)]))
    middles = truth.sheet_to_photo(np.column_stack([(edges[1:] + edges[:-1]) / 2, np.zeros(strips)]))
    return StripsSurface(
        truth.normals(middles), points, truth.rulings(points), truth.ruling_vanishing_points(points)
    )


def _ruling_errors(surface: StripsSurface, truth: Truth) -> RulingErrors:
    return ruling_errors(surface.points, surface.angles_rad, truth, surface.vanishing_points)


@pytest.mark.parametrize("shape", [BOOK, CONE])
def test_exact_strips_of_a_bent_page_have_no_errors(shape: Shape) -> None:
    truth = _curved_truth(shape)
    surface = _exact_strips(truth)
    errors = _ruling_errors(surface, truth)
    assert errors.photo_deg < 1e-6
    assert errors.space_deg < 1e-6
    points = truth.text_points(np.random.default_rng(0))
    normals = normals_at(surface, points)
    assert normals is not None
    # A quarter of a strip's turn is left on average; it shrinks with the strips.
    coarse = normal_error_deg(normals, truth, points)
    fine_normals = normals_at(_exact_strips(truth, 160), points)
    assert fine_normals is not None
    assert coarse < 1.0
    assert normal_error_deg(fine_normals, truth, points) == pytest.approx(coarse / 4, rel=0.15)


def test_rulings_turned_by_an_angle_are_wrong_by_it() -> None:
    # Seen from the front the rulings are parallel, and a turned one is equally wrong all along.
    truth = replace(_curved_truth(BOOK), pose=Pose(translation=(0.0, 0.0, 7.0)))
    exact = _exact_strips(truth)
    turned = replace(exact, angles_rad=exact.angles_rad + np.radians([3.0, -3.0] * 20 + [3.0]))
    assert _ruling_errors(turned, truth).photo_deg == pytest.approx(3.0, abs=1e-6)


def test_vanishing_points_are_judged_as_rays_of_the_true_camera() -> None:
    truth = _curved_truth(BOOK)
    exact = _exact_strips(truth)
    (cx, cy), f = truth.camera.principal_point, truth.focal_length_px
    calibration = np.array([[f, 0, cx], [0, f, cy], [0, 0, 1]])
    direction = truth.rulings_3d(exact.points)[0]
    # 5 degrees away from the ruling, round any axis that is square to it.
    aside = np.cross(direction, [1.0, 0.0, 0.0])
    aside /= np.linalg.norm(aside)
    leaning = np.cos(np.radians(5.0)) * direction + np.sin(np.radians(5.0)) * aside
    vanishing_points = np.tile(-7.0 * calibration @ leaning, (41, 1))
    errors = _ruling_errors(replace(exact, vanishing_points=vanishing_points), truth)
    assert errors.space_deg == pytest.approx(5.0, abs=1e-6)
    assert errors.photo_deg < 1e-6


def test_unknown_vanishing_points_are_left_out() -> None:
    truth = _curved_truth(BOOK)
    exact = _exact_strips(truth)
    some = exact.vanishing_points.copy()
    some[::2] = np.nan
    errors = ruling_errors(exact.points, exact.angles_rad, truth, some)
    assert errors.space_deg < 1e-6
    none = ruling_errors(exact.points, exact.angles_rad, truth)
    assert none.photo_deg < 1e-6
    assert np.isnan(none.space_deg)


def test_normals_turned_by_an_angle_are_wrong_by_it() -> None:
    truth = Truth(PAGE, Plane(), 0.0, Pose(np.radians(30.0), 0.0, 0.0), Camera(500.0, 420, 540))
    exact = _exact_strips(truth, 10)
    turn = np.radians(4.0)
    # The normal lies in the x-z plane: a turn in it is by its whole angle.
    about_y = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    points = np.array([[150.0, 200.0], [260.0, 300.0]])
    normals = normals_at(replace(exact, normals=exact.normals @ about_y.T), points)
    assert normals is not None
    assert normal_error_deg(normals, truth, points) == pytest.approx(4.0, abs=1e-6)


@pytest.mark.parametrize("turn", [0.0, 0.5, 1.5, 2.5, 4.0])
def test_strips_are_found_between_their_rulings_whichever_way_they_lie(turn: float) -> None:
    to_photo = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    rulings = np.column_stack([np.arange(4.0), np.array([5.0, -9.0, 2.0, 0.0])]) @ to_photo
    angles = np.full(4, (np.pi / 2 + turn) % np.pi)
    surface = StripsSurface(np.eye(3), rulings, angles, np.ones((4, 3)))
    points = np.array([[-7.0, 3.0], [0.5, -4.0], [1.1, 0.0], [1.9, 50.0], [2.5, 1.0], [99.0, 0.0]]) @ to_photo
    assert strip_of(surface, points).tolist() == [0, 0, 1, 1, 2, 2]
    assert normals_at(surface, points)[1].tolist() == [1.0, 0.0, 0.0]


def test_a_planes_normal_is_the_same_everywhere_and_may_be_unknown() -> None:
    points = np.zeros((3, 2))
    normals = normals_at(PlaneSurface((0.0, 0.6, 0.8)), points)
    assert normals is not None
    assert normals.tolist() == [[0.0, 0.6, 0.8]] * 3
    assert normals_at(PlaneSurface(None), points) is None


def test_rulings_beside_the_text_are_not_judged() -> None:
    truth = _curved_truth(BOOK)
    exact = _exact_strips(truth)
    beside = replace(
        exact, points=np.zeros((41, 2)), angles_rad=np.full(41, np.pi / 2), normals=exact.normals
    )
    assert np.isnan(_ruling_errors(beside, truth).photo_deg)
    assert np.isnan(_ruling_errors(exact, TRUTH).space_deg), "a page without words"


def test_direction_error_is_modulo_pi() -> None:
    measured = np.radians([89.0, -89.0, 10.0])
    expected = np.radians([-90.0, 91.0, 7.0])
    assert direction_error_deg(measured, expected) == pytest.approx((1 + 0 + 3) / 3)
