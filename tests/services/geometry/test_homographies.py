"""Laws of homographies, for any homography whose vanishing line stays clear of the points."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from services.arrays import Homography, Points
from services.geometry.homographies import (
    denominators,
    directions,
    from_resized,
    jacobians,
    resizing,
    scaling,
    to_resized,
    transform_points,
    translation,
)

ENTRIES = st.floats(-0.4, 0.4)
POINTS = arrays(np.float64, (7, 2), elements=st.floats(-1.0, 1.0))


@st.composite
def homographies(draw: st.DrawFn) -> Homography:
    """Invertible, with a positive denominator (at least 0.2) on the square [-1, 1]^2."""
    a, b, c, d, x, y, p, q = (draw(ENTRIES) for _ in range(8))
    return np.array([[1 + a, b, 5 * x], [-b + 0.1 * c, 1 + d, 5 * y], [p, q, 1.0]])


@given(homographies(), POINTS)
def test_inverse_brings_points_back(H: Homography, points: Points) -> None:
    there = transform_points(H, points)
    assert np.allclose(transform_points(np.linalg.inv(H), there), points, atol=1e-9)


@given(homographies(), homographies(), POINTS)
def test_chains_read_by_adjacent_letters(H_b_a: Homography, H_c_b: Homography, points: Points) -> None:
    middle = transform_points(H_b_a, points)
    far = np.abs(denominators(H_c_b, middle)) > 0.05
    chained = transform_points(H_c_b @ H_b_a, points)
    assert np.allclose(chained[far], transform_points(H_c_b, middle)[far], rtol=1e-8, atol=1e-8)


@given(homographies(), POINTS, st.floats(0.1, 10.0), st.sampled_from([-1.0, 1.0]))
def test_scale_of_the_matrix_means_nothing(H: Homography, points: Points, s: float, sign: float) -> None:
    assert np.allclose(transform_points(sign * s * H, points), transform_points(H, points))
    assert np.allclose(jacobians(sign * s * H, points), jacobians(H, points))


@given(homographies(), POINTS, POINTS, st.sampled_from([-1.0, 1.0]))
def test_directions_are_those_of_the_jacobians(
    H: Homography, points: Points, ways: Points, sign: float
) -> None:
    w = denominators(H, points)
    moved = np.einsum("nij,nj->in", jacobians(H, points), ways)
    assert np.allclose(directions(sign * H, points, ways), moved * w**2, atol=1e-12)


@given(homographies(), POINTS)
def test_jacobians_are_the_finite_differences(H: Homography, points: Points) -> None:
    step = 1e-5
    J = jacobians(H, points)
    for axis in range(2):
        shift = step * np.eye(2)[axis]
        difference = transform_points(H, points + shift) - transform_points(H, points - shift)
        assert np.allclose(J[:, :, axis], difference / (2 * step), rtol=1e-6, atol=1e-6)


@given(homographies(), POINTS)
def test_area_change_falls_with_the_cube_of_the_denominator(H: Homography, points: Points) -> None:
    expected = np.linalg.det(H) / denominators(H, points) ** 3
    assert np.allclose(np.linalg.det(jacobians(H, points)), expected, rtol=1e-9)


def test_textbook_map() -> None:
    # x' = (2x + 1) / (1 + x), y' = 3y / (1 + x), worked out by hand.
    H = np.array([[2.0, 0.0, 1.0], [0.0, 3.0, 0.0], [1.0, 0.0, 1.0]])
    assert np.allclose(transform_points(H, np.array([[1.0, 4.0], [3.0, -2.0]])), [[1.5, 6.0], [1.75, -1.5]])
    # d x'/dx = 1 / (1 + x)^2, d y'/dx = -3y / (1 + x)^2, d y'/dy = 3 / (1 + x)
    assert np.allclose(jacobians(H, np.array([[1.0, 4.0]])), [[[0.25, 0.0], [-3.0, 1.5]]])


@pytest.mark.filterwarnings("error")
def test_vanishing_line_maps_to_infinity_and_parts_the_plane() -> None:
    H = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.0, 1.0]])
    on, before, behind = [-2.0, 1.0], [-1.9, 1.0], [-2.1, 1.0]
    assert np.isinf(transform_points(H, np.array([on]))).all()
    assert np.allclose(np.sign(denominators(H, np.array([on, before, behind]))), [0, 1, -1])


def test_no_points_make_no_points() -> None:
    none = np.zeros((0, 2))
    assert transform_points(np.eye(3), none).shape == (0, 2)
    assert jacobians(np.eye(3), none).shape == (0, 2, 2)


@given(st.integers(2, 7), POINTS)
def test_resizing_is_inverse_and_composes(n: int, points: Points) -> None:
    assert np.allclose(resizing(n) @ resizing(1 / n), np.eye(3))
    assert np.allclose(resizing(0.3) @ resizing(n), resizing(0.3 * n))
    assert np.allclose(transform_points(resizing(n), points), to_resized(points, n))
    assert np.allclose(from_resized(to_resized(points, n), n), points)
    assert np.allclose(to_resized(points, np.array([n, 1.0]))[:, 1], points[:, 1])


@pytest.mark.parametrize("n", [2, 3, 5])
def test_resizing_is_what_area_averages_do(n: int) -> None:
    """An image of its own coordinates, reduced by averages, tells where each new pixel centre lies."""
    y, x = np.mgrid[0 : 4 * n, 0 : 6 * n].astype(np.float64)
    means = [cv2.resize(v, (6, 4), interpolation=cv2.INTER_AREA) for v in (x, y)]
    seen = np.stack(means, axis=-1).reshape(-1, 2)
    pixels = np.stack(np.meshgrid(np.arange(6), np.arange(4)), axis=-1).reshape(-1, 2)
    assert np.allclose(transform_points(resizing(1 / n), seen), pixels)


@given(POINTS, st.floats(-9, 9), st.floats(-9, 9), st.floats(0.1, 9))
def test_shift_and_enlargement(points: Points, x: float, y: float, s: float) -> None:
    assert np.allclose(transform_points(translation(x, y), points), points + np.array([x, y]))
    assert np.allclose(transform_points(scaling(s), points), s * points)
