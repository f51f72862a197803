"""Scales, losses and reweighted fits: closed forms, derivatives by differences, outliers that do not matter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.robust import (
    MEDIAN_LENGTH,
    Loss,
    cauchy,
    cauchy_weights,
    fit_reweighted,
    geman_mcclure_weights,
    narrowing,
    robust_scale,
    soft_l1,
)


def test_the_scale_is_that_of_normal_errors_whatever_a_third_of_them_are() -> None:
    errors = np.random.default_rng(1).normal(0, 2.5, 4000)
    assert robust_scale(errors) == pytest.approx(2.5, rel=0.05)
    errors[:1000] = 1e9
    assert robust_scale(errors) < 2 * 2.5
    assert robust_scale(np.zeros(0), 0.7) == 0.7


def test_the_median_length_of_normal_vectors() -> None:
    vectors = np.random.default_rng(2).normal(0, 3.0, (20000, 2))
    assert np.median(np.hypot(*vectors.T)) / MEDIAN_LENGTH == pytest.approx(3.0, rel=0.02)


@given(st.floats(-50, 50))
def test_residuals_under_a_loss_have_it_as_their_squares(r: float) -> None:
    d = 1e-4
    for under, loss in ((soft_l1, 2 * (np.sqrt(1 + r * r) - 1)), (cauchy, np.log1p(r * r))):
        value, slope = under(np.array([r]))
        assert value[0] ** 2 == pytest.approx(loss, rel=1e-9, abs=1e-15)
        assert value[0] * r >= 0
        assert abs(value[0]) <= abs(r) + 1e-12
        low, high = under(np.array([r - d, r + d]))[0]
        assert slope[0] == pytest.approx((high - low) / (2 * d), rel=1e-4, abs=1e-6)


def test_losses_agree_for_small_residuals_and_order_for_large_ones() -> None:
    r = np.array([1e-9, 1e-3, 0.1, 1.0, 5.0, 100.0])
    soft, hard = soft_l1(r)[0], cauchy(r)[0]
    assert np.allclose(soft[:2], r[:2], rtol=1e-5)
    assert np.allclose(hard[:2], r[:2], rtol=1e-5)
    assert (hard[2:] < soft[2:]).all()
    assert (np.diff(soft) > 0).all()
    assert (np.diff(hard) > 0).all()


@given(st.floats(-20, 20), st.floats(0.1, 5))
def test_weights_are_the_slope_of_the_loss_over_the_residual(r: float, scale: float) -> None:
    """w(r) = rho'(r) / r, by which reweighted squares have the minimum of the loss (Huber and Ronchetti 7.8)."""
    d, x = 1e-4, abs(r) + 0.5
    losses = (
        (cauchy_weights, lambda v: 0.5 * scale**2 * np.log1p((v / scale) ** 2)),
        (geman_mcclure_weights, lambda v: 0.5 * v**2 / (1 + (v / scale) ** 2)),
    )
    for weigh, loss in losses:
        slope = (loss(x + d) - loss(x - d)) / (2 * d)
        assert weigh(np.array([x]), scale)[0] == pytest.approx(slope / x, rel=1e-4, abs=1e-7)


def line(outliers: int) -> tuple[np.ndarray, np.ndarray]:
    """Design and target of y = 3 + 2 x with small errors, and some that are far above."""
    rng = np.random.default_rng(3)
    x = np.linspace(-1, 1, 60)
    y = 3 + 2 * x + rng.normal(0, 0.01, 60)
    y[rng.permutation(60)[:outliers]] += 5.0
    return np.stack([np.ones(60), x], axis=1), y


@pytest.mark.parametrize("loss", [cauchy_weights, geman_mcclure_weights])
def test_a_fit_leaves_outliers_out(loss: Loss) -> None:
    design, y = line(15)
    plain = np.linalg.lstsq(design, y, rcond=None)[0]
    found = fit_reweighted(
        design, y, loss, narrowing(2.0, 0.6, 0.03), 15, start=np.array([np.median(y), 0.0])
    )
    assert np.abs(plain - [3, 2]).max() > 1.0
    assert np.abs(found - [3, 2]).max() < 0.02


def test_one_iteration_without_a_start_is_plain_least_squares_with_the_own_weights() -> None:
    design, y = line(0)
    y[:15] += 5.0
    own = np.where(np.arange(60) < 15, 0.0, 2.0)
    found = fit_reweighted(design, y, cauchy_weights, narrowing(1.0, 1.0, 1.0), 1, weights=own)
    expected = np.linalg.lstsq(design[15:], y[15:], rcond=None)[0]
    assert np.allclose(found, expected, atol=1e-9)


def test_a_start_is_weighted_by_its_residuals() -> None:
    design, y = line(29)
    near, far = (
        fit_reweighted(design, y, geman_mcclure_weights, lambda *_: 0.3, 20, start=np.array([level, 2.0]))
        for level in (3.0, 8.0)
    )
    assert near[0] == pytest.approx(3.0, abs=0.02)
    assert far[0] == pytest.approx(8.0, abs=0.05)


def test_damping_holds_what_nothing_shows() -> None:
    design, y = np.stack([np.ones(5), np.zeros(5)], axis=1), np.full(5, 4.0)
    found = fit_reweighted(design, y, cauchy_weights, lambda *_: 1.0, 3, damping=np.diag([0.0, 1e-3]))
    assert np.allclose(found, [4.0, 0.0])


@pytest.mark.parametrize("weight", [1.0, 1e-3])
def test_damping_that_follows_the_weights_pulls_as_much_however_small_these_are(weight: float) -> None:
    found = fit_reweighted(
        np.ones((5, 1)),
        np.full(5, 4.0),
        lambda residuals, _: np.full(len(residuals), weight),
        narrowing(1.0, 1.0, 1.0),
        2,
        damping=np.array([[5.0]]),
        weigh_damping=True,
    )
    assert found == pytest.approx([2.0])


def test_scales_narrow_to_the_last() -> None:
    scale = narrowing(1.0, 0.5, 0.2)
    assert [scale(k, np.zeros(0)) for k in range(4)] == [1.0, 0.5, 0.25, 0.2]
