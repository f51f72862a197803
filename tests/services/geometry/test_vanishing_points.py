"""Vanishing points of tangent lines that are known to meet, and of some that do not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from services.arrays import Floats, Points, Vector
from services.geometry.vanishing_points import (
    VanishingPoint,
    angular_residuals,
    convergence_quality,
    estimate_vanishing_point,
    tangent_lines,
)

ANGLE = st.floats(-np.pi, np.pi)
SEEDS = range(8)

# Some finite points, near and far, and one at infinity.
TARGETS = [(2.5, 0.4, 1.0), (-1.8, -3.0, 1.0), (40.0, 9.0, 1.0), (-0.2, 600.0, 1.0), (0.8, 0.6, 0.0)]


def scatter(rng: np.random.Generator, count: int) -> Points:
    """Points (count, 2) over a photo in centred units."""
    return rng.uniform([-0.6, -0.8], [0.6, 0.8], (count, 2))


def directions_to(target: tuple[float, float, float], points: Points) -> Vector:
    """Angle (N,) of the line from each point to the homogeneous point `target`."""
    dx, dy = target[0] - points[:, 0] * target[2], target[1] - points[:, 1] * target[2]
    return np.asarray(np.arctan2(dy, dx))


def angle_off(found: VanishingPoint, target: tuple[float, float, float], points: Points) -> float:
    """Largest angle (rad) over the photo between the directions to the found and the true point."""
    off = directions_to(tuple(found.direction), points) - directions_to(target, points)
    return float(np.abs((off + np.pi / 2) % np.pi - np.pi / 2).max())


@given(st.floats(-2, 2), st.floats(-2, 2), ANGLE, st.floats(-3, 3))
def test_tangent_line_holds_its_point_and_those_along_it(x: float, y: float, angle: float, t: float) -> None:
    line = tangent_lines(np.array([[x, y]]), np.array([angle]))[0]
    along = [x + t * np.cos(angle), y + t * np.sin(angle), 1.0]
    beside = [x - t * np.sin(angle), y + t * np.cos(angle), 1.0]
    assert line @ along == pytest.approx(0.0, abs=1e-9)
    assert line @ beside == pytest.approx(t, abs=1e-9)  # unit normal: the distance


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("turned", [0.0, np.pi])
def test_exact_tangents_meet_where_they_must(target: tuple[float, float, float], turned: float) -> None:
    points = scatter(np.random.default_rng(1), 60)
    angles = directions_to(target, points)
    angles[::2] += turned  # a direction is the same modulo pi
    found = estimate_vanishing_point(points, angles, np.ones(60))
    assert np.linalg.norm(found.direction) == pytest.approx(1.0)
    assert angle_off(found, target, points) < 1e-7
    expected = np.array(target) / np.linalg.norm(target)
    assert np.linalg.norm(np.cross(found.direction, expected)) < 1e-6
    assert found.convergence < 1e-7
    assert found.residual_rad < 1e-7
    assert found.inliers.all()


@given(st.floats(1.3, 60.0), ANGLE, st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_exact_tangents_meet_anywhere(distance: float, bearing: float, seed: int) -> None:
    target = (distance * float(np.cos(bearing)), distance * float(np.sin(bearing)), 1.0)
    points = scatter(np.random.default_rng(seed), 25)
    found = estimate_vanishing_point(points, directions_to(target, points), np.ones(25))
    assert angle_off(found, target, points) < 1e-6


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("target", TARGETS)
def test_three_tenths_of_outliers_do_little_harm(target: tuple[float, float, float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise, count = np.radians(0.3), 200
    points = scatter(rng, count)
    angles = directions_to(target, points) + rng.normal(0, noise, count)
    wrong = np.zeros(count, bool)
    wrong[: int(0.3 * count)] = True
    angles[wrong] += rng.uniform(np.radians(5), np.radians(175), wrong.sum())
    found = estimate_vanishing_point(points, angles, np.ones(count))
    # A fit to the 140 good ones alone has a deviation of about 0.3 / sqrt(140) times 2 at the corners.
    assert angle_off(found, target, points) < np.radians(0.35)
    assert (found.inliers & wrong).sum() <= 3
    assert (found.inliers & ~wrong).sum() > 0.95 * (~wrong).sum()
    assert 0.8 * noise < found.residual_rad < 1.25 * noise


@pytest.mark.parametrize("seed", SEEDS)
def test_residual_is_the_noise_and_the_error_what_it_leaves(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise, count, target = np.radians(0.5), 400, (3.0, 0.5, 1.0)
    points = scatter(rng, count)
    angles = directions_to(target, points) + rng.normal(0, noise, count)
    found = estimate_vanishing_point(points, angles, np.ones(count))
    assert 0.85 * noise < found.residual_rad < 1.1 * noise
    assert angle_off(found, target, points) < 8 * noise / np.sqrt(count)


@pytest.mark.parametrize("target", [(1.3, 0.3, 1.0), (-0.6, 1.2, 1.0)])
def test_it_is_the_angles_that_are_fitted(target: tuple[float, float, float]) -> None:
    """As SciPy finds it; least squares of algebraic distances would be off by a tenth of a degree."""
    rng, noise = np.random.default_rng(2), np.radians(0.25)
    points = scatter(rng, 120)
    angles = directions_to(target, points) + rng.normal(0, noise, 120)

    def off(place: Vector) -> Vector:
        return np.asarray(np.sin(directions_to((place[0], place[1], 1.0), points) - angles))

    best = least_squares(off, target[:2], loss="cauchy", f_scale=2 * noise).x
    found = estimate_vanishing_point(points, angles, np.ones(120))
    assert angle_off(found, (best[0], best[1], 1.0), points) < np.radians(0.01)


def test_weights_decide_between_two_points() -> None:
    points = scatter(np.random.default_rng(2), 80)
    first, second = (2.5, 0.4, 1.0), (-1.8, -3.0, 1.0)
    angles = directions_to(first, points)
    angles[40:] = directions_to(second, points[40:])
    for weighty, target in ((slice(0, 40), first), (slice(40, 80), second)):
        weights = np.full(80, 1e-6)
        weights[weighty] = 1.0
        found = estimate_vanishing_point(points, angles, weights)
        assert angle_off(found, target, points) < np.radians(0.1)


def test_convergence_of_a_circles_tangents_is_known() -> None:
    # Tangents (cos t, sin t, -1) of the unit circle: L'L / N = diag(1/2, 1/2, 1), so S3/S1 = sqrt(1/2).
    t = 2 * np.pi * np.arange(36) / 36
    points = np.stack([np.cos(t), np.sin(t)], axis=1)
    lines = tangent_lines(points, t + np.pi / 2)
    assert convergence_quality(lines, np.ones(36)) == pytest.approx(np.sqrt(0.5))


def bent_lines(seed: int) -> tuple[Points, Vector, Vector]:
    """Tangents of parallel arcs, which meet in no point, with weights."""
    rng = np.random.default_rng(seed)
    points = scatter(rng, 90)
    return points, 0.4 * points[:, 0] + 0.1, rng.uniform(0.2, 1.0, 90)


@given(ANGLE, st.floats(1e-3, 1e3), st.integers(0, 2**32 - 1))
@settings(max_examples=50)
def test_convergence_does_not_depend_on_frame_order_or_weight_scale(
    turn: float, scale: float, seed: int
) -> None:
    points, angles, weights = bent_lines(3)
    reference = convergence_quality(tangent_lines(points, angles), weights)
    order = np.random.default_rng(seed).permutation(len(points))
    c, s = np.cos(turn), np.sin(turn)
    turned = points @ np.array([[c, s], [-s, c]])
    flipped = angles + turn + np.pi * (np.arange(len(points)) % 2)
    lines = tangent_lines(turned, flipped)[order]
    assert convergence_quality(lines, scale * weights[order]) == pytest.approx(reference, rel=1e-9)
    assert reference > 0.02


@pytest.mark.parametrize("bend", [0.02, 0.05, 0.2])
def test_convergence_grows_with_the_bend(bend: float) -> None:
    points = scatter(np.random.default_rng(4), 200)
    found = [estimate_vanishing_point(points, b * points[:, 0], np.ones(200)) for b in (bend / 2, bend)]
    assert 0 < found[0].convergence < found[1].convergence


@given(ANGLE, st.floats(-0.5, 0.5), st.sampled_from(TARGETS))
def test_angular_residual_is_the_signed_sine(
    bearing: float, off: float, target: tuple[float, float, float]
) -> None:
    point = 0.5 * np.array([[np.cos(bearing), np.sin(bearing)]])
    angle = directions_to(target, point) - off
    assert angular_residuals(np.array(target), point, angle)[0] == pytest.approx(np.sin(off), abs=1e-9)


@pytest.mark.parametrize("count", [4, 5, 6, 9])
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_directions_of_no_order_give_a_finite_answer(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-np.pi / 2, np.pi / 2, count)
    found = estimate_vanishing_point(scatter(rng, count), angles, rng.uniform(0.05, 1, count))
    values: Floats = np.append(found.direction, [found.convergence, found.residual_rad])
    assert np.isfinite(values).all()
    assert found.inliers.sum() >= count / 2


@pytest.mark.filterwarnings("error")
def test_all_samples_at_one_point_give_a_finite_answer() -> None:
    found = estimate_vanishing_point(np.zeros((8, 2)), np.full(8, 0.3), np.ones(8))
    assert np.isfinite(found.direction).all()
    assert found.convergence == pytest.approx(0.0, abs=1e-12)
