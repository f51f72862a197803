"""A flow between its samples: bends are kept, noise and wild samples are not."""

import numpy as np
import pytest

from services.strips.flow_interpolation import InterpolatedFlow, interpolate_flow
from services.texture_flow.field import FlowSamples, angle_difference

RNG = np.random.default_rng(4)
POINTS = RNG.uniform(-0.6, 0.6, (300, 2))


def bend(points: np.ndarray) -> np.ndarray:
    """Turns by 80 degrees from left to right, faster at the left; never far from vertical modulo pi."""
    return 1.4 + 0.7 * np.tanh(3 * (points[:, 0] + 0.3)) + 0.1 * points[:, 1]


def flow(noise: float = 0.0, wild: float = 0.0, weights: np.ndarray | None = None) -> InterpolatedFlow:
    angles = bend(POINTS) + RNG.normal(0, noise, 300)
    angles = np.where(RNG.random(300) < wild, RNG.uniform(0, np.pi, 300), angles)
    found = interpolate_flow(
        FlowSamples(POINTS, angles % np.pi, np.ones(300) if weights is None else weights)
    )
    assert found is not None
    return found


@pytest.mark.parametrize(("noise", "wild", "limit"), [(0.0, 0.0, 0.01), (0.02, 0.0, 0.02), (0.02, 0.1, 0.03)])
def test_the_bend_is_kept(noise: float, wild: float, limit: float) -> None:
    at = RNG.uniform(-0.5, 0.5, (400, 2))
    assert np.abs(angle_difference(flow(noise, wild).at(at), bend(at))).mean() < limit


def test_support_is_where_the_samples_are() -> None:
    found = flow()
    assert found.support(POINTS[:5]).min() > 0.99
    assert found.support(np.array([[1.5, 0.0]]))[0] < 1e-6


def test_many_samples_are_thinned_and_doubles_do_no_harm() -> None:
    points = np.tile(RNG.uniform(-0.6, 0.6, (1500, 2)), (2, 1))
    found = interpolate_flow(FlowSamples(points, bend(points), np.ones(3000)))
    assert found is not None
    assert np.abs(angle_difference(found.at(points[:100]), bend(points[:100]))).max() < 0.05


@pytest.mark.parametrize("points", [np.zeros((0, 2)), np.zeros((9, 2)), np.outer(np.arange(9), [1.0, 2.0])])
def test_samples_that_span_nothing_are_no_flow(points: np.ndarray) -> None:
    assert interpolate_flow(FlowSamples(points, np.zeros(len(points)), np.ones(len(points)))) is None


def test_samples_of_no_weight_are_finite() -> None:
    assert np.all(np.isfinite(flow(weights=np.zeros(300)).at(POINTS)))
