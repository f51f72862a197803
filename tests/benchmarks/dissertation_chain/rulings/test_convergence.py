"""Convergence of a flow along lines: the closed form against known pencils."""

import numpy as np
import pytest

from benchmarks.dissertation_chain.rulings.convergence import measure_convergence
from benchmarks.dissertation_chain.rulings.text_density import measure_text_density
from services.texture_flow.field import angle_difference

PLACES = np.linspace(-1.0, 1.0, 41)
SQUARE = np.stack(np.meshgrid(np.linspace(-1, 1, 60), np.linspace(-1, 1, 60)), axis=-1).reshape(-1, 2)
DENSITY = measure_text_density(SQUARE, 0.05)


def pencil(x, y):
    return lambda points: np.arctan2(y - points[:, 1], x - points[:, 0])


@pytest.mark.parametrize("meeting", [(3.0, 0.5), (-2.0, 7.0), (0.3, -1.5), (400.0, 30.0)])
def test_lines_of_a_pencil_meet_in_its_point_along_any_line(meeting):
    points = np.array([[0.0, 0.0], [0.3, -0.2]])
    angles = np.tile(np.radians([20.0, 75.0, 130.0]), (2, 1))
    found = measure_convergence(pencil(*meeting), DENSITY.at, points, angles, PLACES)
    assert np.all(np.sqrt(found.mean_square) < 2e-4)
    along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    normal = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    # V = a d + n - b (p, 1), homogeneous.
    v = np.concatenate(
        [
            found.a[..., None] * along + normal - found.b[..., None] * points[:, None],
            -found.b[..., None],
        ],
        axis=-1,
    )
    expected = np.array([*meeting, 1.0])
    cosine = np.abs(v @ expected) / np.linalg.norm(v, axis=-1) / np.linalg.norm(expected)
    assert np.degrees(np.arccos(np.clip(cosine, 0, 1))).max() < 0.05


def test_the_residual_is_the_angle_between_the_flow_and_the_nearest_pencil():
    rng = np.random.default_rng(2)
    deviation = np.radians(0.5)

    def flow(points):
        return pencil(3.0, 0.5)(points) + rng.normal(0.0, deviation, len(points))

    angles = np.tile(np.radians(np.arange(50.0, 130.0, 2.0)), (30, 1))
    points = rng.uniform(-0.3, 0.3, (30, 2))
    found = measure_convergence(flow, DENSITY.at, points, angles, PLACES)
    measured = np.sqrt(found.mean_square.mean()) / deviation
    # Two of about forty degrees of freedom are fitted.
    assert 0.9 < measured < 1.02


def test_the_covariance_tells_the_scatter_of_the_meeting_point():
    rng = np.random.default_rng(3)
    deviation = np.radians(0.5)

    def flow(points):
        return pencil(3.0, 0.5)(points) + rng.normal(0.0, deviation, len(points))

    angles = np.full((500, 1), np.radians(80.0))
    found = measure_convergence(flow, DENSITY.at, np.zeros((500, 2)), angles, PLACES)
    step = PLACES[1] - PLACES[0]
    told = np.sqrt(found.inverse[0, 0].diagonal() * deviation**2 * step)
    seen = np.array([found.a.std(), found.b.std()])
    np.testing.assert_allclose(told / seen, 1.0, atol=0.15)


def test_a_bent_flow_does_not_converge():
    found = measure_convergence(
        lambda points: 0.8 * np.sin(4 * points[:, 0]),
        DENSITY.at,
        np.zeros((1, 2)),
        np.radians([[30.0, 90.0]]),
        PLACES,
    )
    across, along = np.degrees(np.sqrt(found.mean_square[0]))
    assert across > 5.0
    assert along < 1e-3


def test_a_flow_along_the_line_and_a_line_beside_the_text_stay_finite():
    points, angles = np.array([[0.0, 0.0], [50.0, 50.0]]), np.zeros((2, 3))
    for flow in (lambda p: np.zeros(len(p)), lambda p: np.full(len(p), np.nan)):
        found = measure_convergence(flow, DENSITY.at, points, angles, PLACES)
        for values in (found.mean_square, found.a, found.b, found.inverse, found.weight):
            assert np.all(np.isfinite(values))
    assert np.all(found.weight[1] == 0.0)


def test_density_is_one_in_text_and_zero_beside_it():
    assert DENSITY.at(np.array([[0.0, 0.0], [0.5, -0.7]])).min() > 0.95
    assert DENSITY.at(np.array([[1.5, 0.0], [0.0, -9.0]])).max() == 0.0
    assert DENSITY.at(np.zeros((0, 2))).shape == (0,)


def test_angles_of_the_pencil_are_modulo_half_a_turn():
    assert abs(angle_difference(np.array([np.pi + 0.1]), 0.1)[0]) < 1e-12
