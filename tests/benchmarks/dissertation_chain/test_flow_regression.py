"""Dense flow from samples: exact for slow flows, true to bends, finite everywhere."""

import numpy as np
import pytest

from benchmarks.dissertation_chain.flow_regression import regress_flow
from services.texture_flow.field import FlowSamples, angle_difference
from services.texture_flow.regression import smooth_samples


def samples_of(flow, count=500, noise_rad=0.0, seed=0):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.7, 0.7, (count, 2))
    return FlowSamples(points, flow(points) + rng.normal(0.0, noise_rad, count), np.ones(count))


def test_a_bend_keeps_its_size():
    def flow(points):
        return 0.5 * np.sin(4 * points[:, 0])

    samples = samples_of(flow)
    at = np.random.default_rng(1).uniform(-0.6, 0.6, (300, 2))
    error = np.abs(angle_difference(regress_flow(samples, 0.12).at(at), flow(at))).mean()
    in_px = FlowSamples(samples.points * 200 + 200, samples.angles, samples.weights)
    plane = smooth_samples(in_px, (400, 400), 12.0, 0.12 * 200).at(at * 200 + 200)
    assert error < 0.5 * np.abs(angle_difference(plane, flow(at))).mean()
    assert np.degrees(error) < 0.4


def test_noise_is_averaged():
    samples = samples_of(lambda p: 0.2 + 0.1 * p[:, 0], noise_rad=0.02)
    at = np.random.default_rng(1).uniform(-0.5, 0.5, (300, 2))
    error = angle_difference(regress_flow(samples, 0.2).at(at), 0.2 + 0.1 * at[:, 0])
    assert np.sqrt(np.mean(error**2)) < 0.01


def test_directions_are_modulo_half_a_turn():
    samples = samples_of(lambda p: np.pi / 2 - 0.02 + 0.1 * p[:, 1])
    at = np.array([[0.0, 0.4], [0.1, -0.4], [0.0, 0.0]])
    error = angle_difference(regress_flow(samples, 0.2).at(at), np.pi / 2 - 0.02 + 0.1 * at[:, 1])
    assert np.abs(error).max() < 1e-3


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_few_samples_and_far_points_give_finite_directions(count):
    flow = regress_flow(samples_of(lambda p: np.full(len(p), 0.3), count), 0.1)
    places = np.array([[0.0, 0.0], [100.0, -50.0]])
    found = flow.at(places)
    assert np.all(np.isfinite(found))
    assert np.all((flow.trust_at(places) >= 0) & (flow.trust_at(places) <= 1))
    if count:
        np.testing.assert_allclose(found, 0.3, atol=1e-6)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("weight", [0.0, 1.0])
@pytest.mark.parametrize("points", [np.zeros((9, 2)), np.outer(np.arange(9), [1.0, 2.0])])
def test_samples_in_one_place_or_row_and_of_no_weight_are_finite(points, weight):
    flow = regress_flow(FlowSamples(points, np.full(9, 0.3), np.full(9, weight)), 0.5)
    np.testing.assert_allclose(flow.at(points), 0.3 if weight else 0.0, atol=1e-3)
    assert np.all(np.isfinite(flow.trust_at(points)))


def test_trust_falls_at_the_border_and_is_gone_beyond_it():
    x, y = np.meshgrid(np.linspace(-0.7, 0.7, 22), np.linspace(-0.7, 0.7, 22))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    flow = regress_flow(FlowSamples(points, np.zeros(len(points)), np.ones(len(points))), 0.15)
    inside, border, beyond = flow.trust_at(np.array([[0.0, 0.1], [0.69, 0.0], [0.95, 0.0]]))
    assert inside > 0.95
    assert 0.02 < border < 0.75
    assert beyond < 0.02
