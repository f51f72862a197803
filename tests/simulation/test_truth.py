"""The truth against independent means: finite differences, inverses, hand-made numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulation.camera import Camera, Pose
from simulation.flat_page import Page, PageWord
from simulation.folded import Folded
from simulation.photo import frontal_scene
from simulation.scenes import PLANE
from simulation.surfaces import Cylinder, Plane, Shape
from simulation.truth import Truth
from tests.simulation.scene import CAMERA, SHAPES, blank_page, page_grid, truth_of

every_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())


def _direction_error(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs((a - b + np.pi / 2) % np.pi - np.pi / 2)


@every_shape
def test_backward_undoes_forward(shape: Shape) -> None:
    truth = truth_of(shape)
    page = page_grid()
    photo = truth.page_to_photo(page)
    assert np.all(truth.on_page(photo))
    np.testing.assert_allclose(truth.photo_to_page(photo), page, atol=1e-6)


@every_shape
def test_flows_are_the_derivatives_of_the_forward_map(shape: Shape) -> None:
    truth = truth_of(shape)
    page = page_grid()
    photo = truth.page_to_photo(page)
    for axis, flow in ((0, truth.major_flow(photo)), (1, truth.minor_flow(photo))):
        step = np.zeros(2)
        step[axis] = 1e-3
        along = truth.page_to_photo(page + step) - truth.page_to_photo(page - step)
        measured = np.arctan2(along[:, 1], along[:, 0])
        assert _direction_error(flow, measured).max() < 1e-6


def test_flow_ranges() -> None:
    for skew in np.linspace(-1.5, 1.5, 13):
        truth = truth_of(SHAPES["cylinder"], float(skew))
        photo = truth.page_to_photo(page_grid(5))
        major, minor = truth.major_flow(photo), truth.minor_flow(photo)
        assert major.min() >= -np.pi / 2
        assert major.max() < np.pi / 2
        assert minor.min() >= 0
        assert minor.max() < np.pi


def test_positive_skew_turns_the_print_clockwise() -> None:
    page = blank_page()
    plane, pose, camera = frontal_scene(page)
    truth = Truth(page, plane, 0.3, pose, camera)
    centre = np.array([[(page.width - 1) / 2, (page.height - 1) / 2]])
    assert truth.major_flow(centre)[0] == pytest.approx(0.3)
    right = truth.page_to_photo(centre + np.array([50.0, 0.0])) - truth.page_to_photo(centre)
    np.testing.assert_allclose(right[0], [50 * np.cos(0.3), 50 * np.sin(0.3)], atol=1e-9)


def test_tilt_takes_the_named_side_away() -> None:
    page = blank_page()
    right_far = Truth(page, PLANE, 0.0, Pose(0.5, 0.0, 0.0, (0.0, 0.0, 3.0)), CAMERA)
    foot_far = Truth(page, PLANE, 0.0, Pose(0.5, np.pi / 2, 0.0, (0.0, 0.0, 3.0)), CAMERA)
    corners = np.array([[0.0, 0.0], [319.0, 0.0], [319.0, 439.0], [0.0, 439.0]])
    a, b, c, d = right_far.page_to_photo(corners)
    assert np.linalg.norm(c - b) < 0.9 * np.linalg.norm(d - a)
    a, b, c, d = foot_far.page_to_photo(corners)
    assert np.linalg.norm(c - d) < 0.9 * np.linalg.norm(b - a)


@every_shape
def test_normals_are_the_cross_product_of_the_surface(shape: Shape) -> None:
    truth = truth_of(shape)
    page = page_grid()

    def place(points: np.ndarray) -> np.ndarray:
        return truth.pose.to_camera(shape.place(truth.page.sheet_from_page(points, truth.skew_rad)))

    right, foot = np.array([1e-3, 0.0]), np.array([0.0, 1e-3])
    across = place(page + right) - place(page - right)
    down = place(page + foot) - place(page - foot)
    expected = np.cross(across, down)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(truth.normals(truth.page_to_photo(page)), expected, atol=1e-6)


@every_shape
def test_the_normal_does_not_change_along_a_ruling(shape: Shape) -> None:
    truth = truth_of(shape)
    photo = truth.page_to_photo(page_grid(5))
    angle = truth.rulings(photo)
    moved = photo + 6.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(truth.normals(moved), truth.normals(photo), atol=1e-9)
    np.testing.assert_allclose(truth.rulings_3d(moved), truth.rulings_3d(photo), atol=1e-9)


@every_shape
def test_ruling_runs_towards_its_vanishing_point(shape: Shape) -> None:
    truth = truth_of(shape)
    photo = truth.page_to_photo(page_grid(5))
    vanishing = truth.ruling_vanishing_points(photo)
    towards = vanishing[:, :2] - vanishing[:, 2:] * photo
    assert _direction_error(np.arctan2(towards[:, 1], towards[:, 0]), truth.rulings(photo)).max() < 1e-9


def test_cylinder_rulings_share_one_vanishing_point_and_cone_rulings_do_not() -> None:
    def spread(name: str) -> float:
        truth = truth_of(SHAPES[name])
        rays = truth.ruling_vanishing_points(truth.page_to_photo(page_grid(5)))
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        return float(np.linalg.svd(rays, compute_uv=False)[1])

    assert spread("cylinder") < 1e-9
    assert spread("hump") > 1e-3


def test_cone_rulings_meet_in_the_photo_of_its_apex() -> None:
    truth = truth_of(SHAPES["hump"])
    photo = truth.page_to_photo(page_grid(5))
    apex = truth.camera.project(truth.pose.to_camera(np.array([[0.4, -4.0, 0.0]])))
    towards = apex - photo
    assert _direction_error(np.arctan2(towards[:, 1], towards[:, 0]), truth.rulings(photo)).max() < 1e-9


def test_planar_vanishing_points_are_where_the_flows_converge() -> None:
    truth = truth_of(Plane())
    photo = truth.page_to_photo(page_grid(5))
    lines, strokes = truth.flow_vanishing_points()
    for vanishing, flow in ((lines, truth.major_flow(photo)), (strokes, truth.minor_flow(photo))):
        towards = vanishing[:2] - vanishing[2] * photo
        assert _direction_error(np.arctan2(towards[:, 1], towards[:, 0]), flow).max() < 1e-9
    # Perpendicular in space: the relation from which the focal length is estimated (3.2.3).
    centred = [v[:2] / v[2] - truth.camera.principal_point for v in (lines, strokes)]
    assert np.sqrt(-centred[0] @ centred[1]) == pytest.approx(truth.focal_length_px)


def test_homography_is_the_forward_map_of_a_plane() -> None:
    truth = truth_of(Plane())
    page = page_grid()
    mapped = np.column_stack([page, np.ones(len(page))]) @ truth.H_photo_page().T
    np.testing.assert_allclose(mapped[:, :2] / mapped[:, 2:], truth.page_to_photo(page), atol=1e-8)


def test_only_planes_have_a_homography() -> None:
    truth = truth_of(Cylinder((0.0, 0.1, 0.2)))
    with pytest.raises(ValueError, match="planar"):
        truth.H_photo_page()
    with pytest.raises(ValueError, match="planar"):
        truth.flow_vanishing_points()


def test_half_field_of_view_by_hand() -> None:
    assert Camera(500.0, 601, 801).half_field_of_view_rad == pytest.approx(np.pi / 4)


@every_shape
def test_backward_map_agrees_with_the_exact_points(shape: Shape) -> None:
    truth = truth_of(shape)
    dense = truth.backward_map()
    rows, columns = np.nonzero(truth.page_mask())
    inside = np.random.default_rng(3).choice(len(rows), 500, replace=False)
    points = np.column_stack([columns[inside], rows[inside]]).astype(float)
    exact = truth.photo_to_page(points)
    # A crease is sharper than the lattice that the map is made from.
    worst = 0.4 if isinstance(shape, Folded) else 0.05
    assert np.abs(dense[rows[inside], columns[inside]] - exact).max() < worst
    assert np.isnan(dense[0, 0]).all()


def test_words_that_are_cut_do_not_count() -> None:
    page = blank_page()
    plane, pose, camera = frontal_scene(page)
    straight = Truth(page, plane, 0.0, pose, camera)
    assert [word.text for line in straight.visible_lines() for word in line] == ["corner", "middle"]
    # Turned, the corner word leaves the page's frame (Figure A.1).
    turned = Truth(page, plane, 0.3, pose, camera)
    assert [word.text for line in turned.visible_lines() for word in line] == ["middle"]
    # Shifted, it leaves the photo.
    aside = Truth(page, plane, 0.0, Pose(translation=(-0.1, 0.0, pose.translation[2])), camera)
    assert [word.text for line in aside.visible_lines() for word in line] == ["middle"]


def test_text_mask_and_points_lie_in_words() -> None:
    truth = truth_of(SHAPES["cylinder"], 0.0)
    mask = truth.text_mask()
    points = truth.text_points(np.random.default_rng(1), 200)
    page = truth.photo_to_page(points)
    boxes = np.array([word.box for line in truth.page.lines for word in line])
    within = (page[:, None, 0] > boxes[:, 0]) & (page[:, None, 0] < boxes[:, 2])
    within &= (page[:, None, 1] > boxes[:, 1]) & (page[:, None, 1] < boxes[:, 3])
    assert within.any(axis=1).all()
    near = np.round(points).astype(int)
    assert mask[near[:, 1], near[:, 0]].mean() > 0.9
    assert 0.001 < mask.mean() < 0.05


def test_a_page_that_turns_its_back_is_refused() -> None:
    hidden = Truth(blank_page(), Cylinder((0.0, 0.0, 0.6)), 0.0, Pose(1.1), CAMERA)
    with pytest.raises(ValueError, match="hides itself"):
        hidden.check_visible()
    behind = Truth(blank_page(), Plane(), 0.0, Pose(translation=(0.0, 0.0, -3.0)), CAMERA)
    with pytest.raises(ValueError, match="behind the camera"):
        behind.check_visible()
    truth_of(Plane()).check_visible()


def test_no_words_no_points() -> None:
    page = Page(np.full((60, 60), 255, np.uint8), ((PageWord("off", (-20.0, 0.0, -5.0, 9.0)),),))
    truth = Truth(page, Plane(), 0.0, Pose(), CAMERA)
    assert truth.text_points(np.random.default_rng(0)).shape == (0, 2)


angles = st.floats(-np.pi, np.pi)


@given(st.floats(0, 0.8), angles, angles, angles, st.floats(2.5, 6.0))
def test_any_pose_of_a_plane_is_undone(
    tilt: float, azimuth: float, roll: float, skew: float, distance: float
) -> None:
    truth = Truth(blank_page(), Plane(), skew, Pose(tilt, azimuth, roll, (0.2, -0.1, distance)), CAMERA)
    page = page_grid(3)
    photo = truth.page_to_photo(page)
    np.testing.assert_allclose(truth.photo_to_page(photo), page, atol=1e-6)
    normal = truth.normals(photo[:1])[0]
    assert np.arccos(np.clip(normal[2], -1, 1)) == pytest.approx(tilt, abs=1e-6)
    # Rolling the camera turns the photo and every direction in it.
    rolled = Truth(truth.page, Plane(), skew, Pose(tilt, azimuth, roll + 0.3, truth.pose.translation), CAMERA)
    assert np.allclose(rolled.normals(photo[:1])[0, 2], normal[2])
