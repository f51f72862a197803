"""The pin-hole against textbook fields of view, SciPy's rotations and the simulator's own camera."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from services.arrays import Floats
from services.geometry.camera import (
    FULL_FRAME_DIAGONAL_MM,
    TYPICAL_FOCAL_LENGTH,
    field_of_view,
    focal_length_from_vanishing_points,
    plane_to_image,
    rotation_from_flows,
    rotation_from_vector,
)
from services.geometry.homographies import transform_points
from simulation.camera import Camera, Pose

ANGLE = st.floats(-np.pi, np.pi)
COORDINATE = st.floats(-4.0, 4.0)
FOCAL = st.floats(0.5, 4.0)


@st.composite
def leaning_frames(draw: st.DrawFn) -> Floats:
    """Rotation (3, 3) of a page that faces the camera, its x axis more to the right than to the left."""
    tilt, azimuth = draw(st.floats(0.0, 1.2)), draw(ANGLE)
    R = Rotation.from_euler("zyz", [draw(st.floats(-1.2, 1.2)) - azimuth, tilt, azimuth]).as_matrix()
    assume(R[0, 0] > 1e-3)
    return np.asarray(R)


def vanishing_point(direction: Floats, focal: float) -> Floats:
    """Image (homogeneous) of the point that is infinitely far in `direction`."""
    return np.array([focal * direction[0], focal * direction[1], direction[2]])


@pytest.mark.parametrize(("focal_mm", "degrees"), [(24, 84.06), (28, 75.38), (50, 46.79), (200, 12.35)])
def test_fields_of_view_of_photographers_tables(focal_mm: float, degrees: float) -> None:
    assert np.degrees(field_of_view(focal_mm, 36, 24)) == pytest.approx(degrees, abs=0.01)
    assert np.degrees(field_of_view(100 * focal_mm, 3600, 2400)) == pytest.approx(degrees, abs=0.01)


def test_typical_camera_is_a_phones_main_camera() -> None:
    assert np.hypot(36, 24) == pytest.approx(FULL_FRAME_DIAGONAL_MM, abs=1e-4)
    diagonal = float(np.hypot(4000, 3000))
    assert 73 < np.degrees(field_of_view(TYPICAL_FOCAL_LENGTH * diagonal, 4000, 3000)) < 80


@given(leaning_frames(), FOCAL, st.floats(0.1, 9), st.sampled_from([-1.0, 1.0]))
def test_focal_length_of_an_orthogonal_frame(R: Floats, focal: float, scale: float, sign: float) -> None:
    assume(abs(R[2, 0] * R[2, 1]) > 1e-4)  # both vanishing points finite
    v_h, v_v = sign * scale * vanishing_point(R[:, 0], focal), vanishing_point(R[:, 1], focal)
    assert focal_length_from_vanishing_points(v_h, v_v) == pytest.approx(focal, rel=1e-6)
    assert focal_length_from_vanishing_points(v_v, v_h) == pytest.approx(focal, rel=1e-6)


@pytest.mark.parametrize(
    ("v_h", "v_v"),
    [
        ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),  # frontal: both at infinity
        ([1.0, 0.0, 0.0], [0.0, 2.0, 1.0]),  # text lines parallel to the image plane
        ([3.0, 0.1, 1.0], [0.0, 1.0, 0.0]),
        ([3.0, 0.5, 1.0], [0.5, 2.0, 1.0]),  # v_h . v_v > 0: noise
        ([3.0, 0.0, 1.0], [0.0, 2.0, 1.0]),  # v_h . v_v = 0: no focal length at all
    ],
)
def test_no_focal_length_where_none_can_be_solved_for(v_h: list[float], v_v: list[float]) -> None:
    assert focal_length_from_vanishing_points(np.array(v_h), np.array(v_v)) is None


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_axis_angle_is_scipys(x: float, y: float, z: float) -> None:
    vector = np.array([x, y, z])
    assert np.allclose(rotation_from_vector(vector), Rotation.from_rotvec(vector).as_matrix(), atol=1e-9)


@pytest.mark.parametrize("size", [0.0, 1e-14, 1e-10, 1e-6])
def test_small_turns(size: float) -> None:
    K = rotation_from_vector(size * np.array([1.0, 0.0, 0.0])) - np.eye(3)
    assert K[2, 1] == pytest.approx(size, abs=1e-12)
    assert K[1, 2] == pytest.approx(-size, abs=1e-12)


@given(leaning_frames(), FOCAL, st.sampled_from([-2.0, 1.0]), st.sampled_from([-1.0, 3.0]))
def test_frame_comes_back_from_its_vanishing_points(R: Floats, focal: float, a: float, b: float) -> None:
    found = rotation_from_flows(
        a * vanishing_point(R[:, 0], focal), b * vanishing_point(R[:, 1], focal), focal
    )
    assert np.allclose(found, R, atol=1e-9)


@given(st.tuples(*[COORDINATE] * 3), st.tuples(*[COORDINATE] * 3), FOCAL)
def test_any_two_directions_make_a_rotation(
    first: tuple[float, ...], second: tuple[float, ...], focal: float
) -> None:
    v_h, v_v = np.array(first), np.array(second)
    V_h, V_v = v_h * [1, 1, focal], v_v * [1, 1, focal]
    assume(min(np.linalg.norm(V_h), np.linalg.norm(V_v)) > 1e-2)
    V_h, V_v = V_h / np.linalg.norm(V_h), V_v / np.linalg.norm(V_v)
    # The page is not seen from its edge, and the two directions are not the same.
    assume(abs(np.cross(V_h, V_v)[2]) > 1e-3 and abs(V_h[0]) > 1e-9)
    R = rotation_from_flows(v_h, v_v, focal)
    assert np.allclose(R.T @ R, np.eye(3), atol=1e-9)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert R[2, 2] > 0
    # The error is shared: both axes are turned by the same angle from what was seen, less than 45 degrees.
    turned = [abs(float(R[:, 0] @ V_h)), abs(float(R[:, 1] @ V_v))]
    assert turned[0] == pytest.approx(turned[1], abs=1e-9)
    assert turned[0] > np.cos(np.pi / 4) - 1e-9
    # In the plane of the two directions: the normal is theirs.
    assert abs(float(R[:, 2] @ V_h)) < 1e-6
    assert abs(float(R[:, 2] @ V_v)) < 1e-6


@given(
    st.floats(0.0, 1.1),
    ANGLE,
    ANGLE,
    st.floats(2.0, 9.0),
    st.floats(300.0, 3000.0),
)
def test_plane_to_image_is_the_simulators_camera(
    tilt: float, azimuth: float, roll: float, distance: float, focal_px: float
) -> None:
    pose = Pose(tilt, azimuth, roll, (0.0, 0.0, distance))
    camera = Camera(focal_px, 1001, 1401)
    x, y = np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1.4, 1.4, 5))
    sheet = np.stack([x.ravel(), y.ravel()], axis=1)
    seen = camera.project(pose.to_camera(np.column_stack([sheet, np.zeros(25)]))) - camera.principal_point
    # The plane's unit is the image's at the principal point: half a page is f / distance of it.
    ours = transform_points(plane_to_image(pose.rotation(), focal_px), sheet * focal_px / distance)
    assert np.allclose(ours, seen, rtol=1e-9, atol=1e-6)


def test_frontal_plane_is_the_image() -> None:
    H = plane_to_image(np.eye(3), 1.7)
    assert np.allclose(H, np.eye(3))
