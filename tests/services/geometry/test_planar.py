"""The closed-form pose: exact from exact vanishing points, and sane in every degenerate case of 3.2.3."""

import numpy as np
import pytest

from services.geometry.homographies import transform_points
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import estimate_plane
from services.geometry.vanishing_points import FlowVanishingPoints, VanishingPoint
from services.rectify.analysis.focal_length import EXIF_DEVIATION, GIVEN_DEVIATION, focal_prior
from services.texture_flow.field import FlowSamples
from services.texture_flow.vanishing_points import estimate_vanishing_points
from simulation.scenes import POSES, View
from tests.services.sheet.plane.observations import PrintedPlane, photograph_plane

FRAME = PhotoFrame(1050, 1350)
ASSUMED = focal_prior(FRAME, None, None)


def at(direction: tuple[float, float, float]) -> VanishingPoint:
    """A vanishing point that is known exactly."""
    unit = np.array(direction) / np.linalg.norm(direction)
    return VanishingPoint(unit, 0.0, 0.0, np.ones(1, bool))


def true_points(plane: PrintedPlane) -> FlowVanishingPoints:
    """The simulator's vanishing points in centred unit coordinates."""
    H = np.linalg.inv(plane.frame.H_photo_centred)
    h, v = plane.truth.flow_vanishing_points() @ H.T
    return FlowVanishingPoints(at(tuple(h)), at(tuple(v)))


def test_frame_is_centred_with_half_the_diagonal_as_unit() -> None:
    corners = np.array([[0.0, 0.0], [1049.0, 1349.0], [524.5, 674.5]])
    samples = FlowSamples(corners, np.arange(3.0), np.ones(3)).centred(FRAME)
    assert np.allclose(samples.points[2], 0.0)
    assert np.allclose(samples.points[0], -samples.points[1])
    assert np.linalg.norm(samples.points[0]) == pytest.approx(1.0, abs=0.002)  # pixel centres, not edges
    assert samples.angles.tolist() == [0.0, 1.0, 2.0]
    assert np.allclose(transform_points(FRAME.H_photo_centred, samples.points), corners)


def test_prior_takes_the_best_knowledge_at_hand() -> None:
    both = focal_prior(FRAME, 900.0, 1000.0)
    assert (both.source, both.deviation) == ("given", GIVEN_DEVIATION)
    assert np.exp(both.log_focal) * FRAME.unit_px == pytest.approx(900.0)
    exif = focal_prior(FRAME, None, 1000.0)
    assert (exif.source, exif.deviation) == ("exif", EXIF_DEVIATION)
    assert np.exp(exif.log_focal) * FRAME.unit_px == pytest.approx(1000.0)
    assert ASSUMED.source == "assumed"
    # A phone's main camera: 28 mm on the diagonal of 43.27 mm, in half diagonals.
    assert np.exp(ASSUMED.log_focal) == pytest.approx(28 / 21.63, rel=1e-3)
    assert GIVEN_DEVIATION < EXIF_DEVIATION < ASSUMED.deviation


@pytest.mark.parametrize("view", POSES, ids=lambda view: f"pose{view.name}")
@pytest.mark.parametrize("skew_deg", [0, 15, -15])
def test_exact_points_give_the_exact_pose(view: View, skew_deg: float) -> None:
    plane = photograph_plane(view, float(np.radians(skew_deg)))
    found = estimate_plane(true_points(plane), ASSUMED)
    assert plane.error_deg(found) < 1e-5
    assert found.focal == pytest.approx(plane.focal, rel=1e-7)
    # The plane's map is the simulator's, up to the place and scale of the page.
    page = np.array([[0.0, 0.0], [799.0, 0.0], [799.0, 1249.0], [0.0, 1249.0], [300.0, 500.0]])
    flat = transform_points(
        np.linalg.inv(found.H_centred_plane), transform_points(plane.H_centred_page, page)
    )
    scale = np.linalg.norm(flat[1] - flat[0]) / 799
    assert np.allclose(flat - flat[0], scale * (page - page[0]), atol=1e-6)


@pytest.mark.parametrize("view", POSES, ids=lambda view: f"pose{view.name}")
def test_a_known_focal_length_is_taken(view: View) -> None:
    plane = photograph_plane(view)
    points = true_points(plane)
    for focal_px in (plane.truth.focal_length_px, 0.8 * plane.truth.focal_length_px):
        for prior in (focal_prior(plane.frame, focal_px, None), focal_prior(plane.frame, None, focal_px)):
            found = estimate_plane(points, prior)
            assert found.focal * plane.frame.unit_px == pytest.approx(focal_px)
    assert (
        plane.error_deg(estimate_plane(points, focal_prior(plane.frame, plane.truth.focal_length_px, None)))
        < 1e-5
    )


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_the_flows_leaves_a_small_error(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plane = photograph_plane(POSES[2])
    major, minor = plane.flow(0.0, np.radians(0.2), rng), plane.flow(np.pi / 2, np.radians(0.5), rng)
    found = estimate_plane(estimate_vanishing_points(major, minor), ASSUMED)
    assert plane.error_deg(found) < 2.0
    assert abs(np.log(found.focal / plane.focal)) < 0.1


FOCAL = float(np.exp(ASSUMED.log_focal))


@pytest.mark.parametrize(
    ("v_h", "v_v"),
    [
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),  # both at infinity: frontal
        ((1.0, 0.1, 0.0), (0.05, 1.0, 0.0)),  # both at infinity and not orthogonal: noise
        ((-1.0, 0.1, 0.0), (0.05, -1.0, 0.0)),
        ((1.0, 0.0, 0.0), (0.0, 2.5, 1.0)),  # v_h at infinity
        ((1.0, 0.1, 0.0), (0.4, 2.5, 1.0)),  # ... and not orthogonal
        ((2.5, 0.0, 1.0), (0.0, 1.0, 0.0)),  # v_v at infinity
        ((-2.5, 0.3, 1.0), (0.1, -1.0, 0.0)),
        ((3.0, 0.5, 1.0), (0.5, 2.0, 1.0)),  # v_h . v_v > 0
        ((3.0, 1.0, 1.0), (-1.0, 3.0, 1.0)),  # v_h . v_v = 0: f = 0
        ((1e9, 0.0, 1.0), (0.0, -1e9, 1.0)),  # as good as infinity
    ],
)
@pytest.mark.filterwarnings("error")
def test_degenerate_points_give_a_proper_pose_of_the_priors_focal_length(
    v_h: tuple[float, float, float], v_v: tuple[float, float, float]
) -> None:
    plane = estimate_plane(FlowVanishingPoints(at(v_h), at(v_v)), ASSUMED)
    assert plane.focal == pytest.approx(FOCAL)
    R = plane.rotation
    assert np.isfinite(R).all()
    assert np.allclose(R.T @ R, np.eye(3))
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert R[2, 2] > 0
    assert R[0, 0] > 0.5
    assert R[1, 1] > 0.5
    assert np.isfinite(np.linalg.inv(plane.H_centred_plane)).all()
    # Lines and strokes are made as nearly level and upright as a right angle between them allows.
    V_h, V_v = (np.array(v) * [1, 1, FOCAL] for v in (v_h, v_v))
    turns = [
        np.arccos(min(abs(float(R[:, k] @ v)) / np.linalg.norm(v), 1.0)) for k, v in ((0, V_h), (1, V_v))
    ]
    between = np.arccos(min(abs(float(V_h @ V_v)) / np.linalg.norm(V_h) / np.linalg.norm(V_v), 1.0))
    assert np.allclose(turns, (np.pi / 2 - between) / 2, atol=1e-6)


def test_frontal_points_change_nothing() -> None:
    plane = estimate_plane(FlowVanishingPoints(at((1.0, 0.0, 0.0)), at((0.0, 1.0, 0.0))), ASSUMED)
    assert np.allclose(plane.rotation, np.eye(3))
    assert np.allclose(plane.H_centred_plane, np.eye(3))


def test_one_point_at_infinity_still_removes_the_foreshortening() -> None:
    # The page leans away at its foot by 30 degrees: text lines stay parallel, strokes meet.
    plane = photograph_plane(View("foot", 2300.0, 30.0, 90.0, 0.0))
    points = true_points(plane)
    assert abs(points.horizontal.direction[2]) < 1e-9
    prior = focal_prior(plane.frame, plane.truth.focal_length_px, None)
    assert plane.error_deg(estimate_plane(points, prior)) < 1e-5
    # Without knowing f, the tilt is off by what the assumed f is, and lines and strokes are straight all the same.
    found = estimate_plane(points, ASSUMED)
    grid = np.stack(np.meshgrid(np.linspace(0, 799, 4), np.linspace(0, 1249, 4)), axis=-1).reshape(-1, 2)
    flat = transform_points(
        np.linalg.inv(found.H_centred_plane), transform_points(plane.H_centred_page, grid)
    )
    rows = flat.reshape(4, 4, 2)
    assert np.allclose(np.ptp(rows[:, :, 1], axis=1), 0.0, atol=1e-9)
    assert np.allclose(np.ptp(rows[:, :, 0], axis=0), 0.0, atol=1e-9)


def test_an_unbelievable_focal_length_is_bounded() -> None:
    # Orthogonal directions, seen with focal lengths that no camera at hand has.
    V_h = np.array([0.9, 0.1, 0.4])
    V_v = np.cross(np.cross([0.1, 0.9, -0.5], V_h), V_h)
    found = []
    for focal in (0.05, FOCAL, 40.0):
        points = FlowVanishingPoints(*(at((focal * v[0], focal * v[1], v[2])) for v in (V_h, V_v)))
        found.append(estimate_plane(points, ASSUMED).focal)
    short, right, long = found
    assert right == pytest.approx(FOCAL)
    assert FOCAL / 4 < short < FOCAL / 1.5
    assert short * long == pytest.approx(FOCAL**2)
