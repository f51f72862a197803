"""Orientation fields: their look-up, smoothing, extrapolation and outliers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.arrays import Points, Vector
from services.texture_flow.field import FlowField, FlowSamples, angle_difference, resize_field
from services.texture_flow.regression import reject_outliers, smooth_samples

ANGLE = st.floats(-10, 10)
SHAPE = (600, 450)


def scatter(count: int, seed: int = 0) -> Points:
    """Points (count, 2) over an image of `SHAPE`."""
    return np.random.default_rng(seed).uniform([0, 0], [SHAPE[1] - 1, SHAPE[0] - 1], (count, 2))


@given(ANGLE, ANGLE, st.integers(-3, 3))
def test_directions_differ_modulo_pi(a: float, b: float, turns: int) -> None:
    d = float(angle_difference(np.array([a]), b)[0])
    assert -np.pi / 2 <= d < np.pi / 2 + 1e-12
    assert np.sin(d - (a - b)) == pytest.approx(0.0, abs=1e-9)  # equal modulo pi
    again = float(angle_difference(np.array([a + turns * np.pi]), b)[0])
    assert np.sin(again - d) == pytest.approx(0.0, abs=1e-9)


def slow_look_up(field: FlowField, point: Vector) -> float:
    """Bilinear look-up of one point by the four nodes round it."""
    rows, columns = field.doubled.shape[:2]
    u, v = (point - field.origin) / field.spacing_px
    u, v = float(np.clip(u, 0, columns - 1)), float(np.clip(v, 0, rows - 1))
    c, r = min(int(u), columns - 2), min(int(v), rows - 2)
    s, t = u - c, v - r
    n = field.doubled
    value = (1 - t) * ((1 - s) * n[r, c] + s * n[r, c + 1]) + t * (
        (1 - s) * n[r + 1, c] + s * n[r + 1, c + 1]
    )
    return float(0.5 * np.arctan2(value[1], value[0]))


def smooth_field(seed: int) -> FlowField:
    """Field over 9 x 7 nodes whose directions wander by some tenths of a radian."""
    rng = np.random.default_rng(seed)
    angle = 0.5 + np.cumsum(rng.normal(0, 0.05, (9, 7)), axis=0) + 0.03 * np.arange(7)
    return FlowField(np.stack([np.cos(2 * angle), np.sin(2 * angle)], axis=-1), (3.0, -5.0), 40.0)


@pytest.mark.parametrize("count", [1, 2, 4095, 4096, 4097, 9000])
def test_look_up_is_bilinear_and_constant_beyond(count: int) -> None:
    field = smooth_field(1)
    points = np.random.default_rng(2).uniform(-150, 500, (count, 2))
    found = field.at(points)
    assert found.shape == (count,)
    for n in np.unique(np.linspace(0, count - 1, 60).astype(int)):
        # Places are known to 1/32 of the spacing, and neighbours differ by less than 0.2.
        assert abs(angle_difference(found[n : n + 1], slow_look_up(field, points[n]))[0]) < 0.2 / 32


def test_look_up_of_nothing() -> None:
    assert smooth_field(1).at(np.zeros((0, 2))).shape == (0,)


@given(st.floats(0, np.pi), st.integers(1, 40), st.integers(0, 999), st.sampled_from([1, 2]))
@settings(max_examples=40)
def test_a_constant_field_is_reproduced_everywhere(angle: float, count: int, seed: int, order: int) -> None:
    points = scatter(count, seed)
    samples = FlowSamples(points, np.full(count, angle), np.linspace(0.1, 1, count))
    field = smooth_samples(samples, SHAPE, 30.0, 50.0, order)
    everywhere = np.concatenate([scatter(200, 1), 4 * scatter(50, 2) - 2 * np.array(SHAPE[::-1])])
    assert np.abs(angle_difference(field.at(everywhere), angle)).max() < 1e-4


@pytest.mark.parametrize("gradient", [(0.1, 0.0), (0.0, -0.1), (0.07, 0.08)])
def test_a_linear_field_is_reproduced_among_its_samples(gradient: tuple[float, float]) -> None:
    slope = np.array(gradient) / 300  # some degrees over the image
    y, x = np.mgrid[10:600:20, 10:450:20]
    points = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float64)
    samples = FlowSamples(points, 0.2 + points @ slope, np.ones(len(points)))
    field = smooth_samples(samples, SHAPE, 25.0, 50.0)
    at = scatter(300, 3)
    error = np.degrees(np.abs(angle_difference(field.at(at), 0.2 + at @ slope)))
    inside = ((at > 80) & (at < np.array(SHAPE[::-1]) - 80)).all(axis=1)
    assert error[inside].max() < 0.1
    # At the rim slopes are damped; without them a mean over half a Gaussian would be wrong by twice as much.
    assert error.max() < 0.5


@pytest.mark.parametrize("bend", [(4e-6, 0.0, 0.0), (0.0, 0.0, -4e-6), (2e-6, 3e-6, 1e-6)])
def test_a_bend_is_reproduced_by_a_quadric_and_cut_off_by_a_plane(bend: tuple[float, float, float]) -> None:
    def angle(at: Points) -> Vector:
        x, y = (at - np.array([225.0, 300.0])).T
        return np.asarray(0.2 + bend[0] * x * x + bend[1] * x * y + bend[2] * y * y)

    y, x = np.mgrid[10:600:20, 10:450:20]
    points = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float64)
    samples = FlowSamples(points, angle(points), np.ones(len(points)))
    at = scatter(400, 3)
    inside = ((at > 90) & (at < np.array(SHAPE[::-1]) - 90)).all(axis=1)
    errors = []
    for order in (1, 2):
        field = smooth_samples(samples, SHAPE, 12.5, 50.0, order)
        errors.append(np.degrees(np.abs(angle_difference(field.at(at), angle(at)))))
    # A plane is off by the bend over a Gaussian: half its curvature times the variance, both ways.
    off = np.degrees(abs(bend[0] + bend[2]) * 50.0**2)
    assert np.median(errors[0][inside]) == pytest.approx(off, rel=0.15)
    assert errors[1][inside].max() < 0.04
    assert errors[1].max() < 0.6


@pytest.mark.parametrize("order", [1, 2])
def test_a_bent_field_has_no_outliers_but_those_that_are(order: int) -> None:
    points = scatter(500, 11)
    angles = 0.1 + 2e-6 * (points[:, 0] - 200) ** 2 + np.random.default_rng(12).normal(0, 0.003, 500)
    angles[::25] += 0.5
    kept = reject_outliers(FlowSamples(points, angles, np.ones(500)), 50.0, SHAPE, np.radians(8.0), order)
    assert 0.93 * 480 < len(kept) <= 480
    assert not {tuple(p) for p in points[::25]} & {tuple(p) for p in kept.points}


def test_a_quadric_is_rougher_than_a_plane() -> None:
    points, noise = scatter(600, 5), np.radians(1.0)
    samples = FlowSamples(points, 0.3 + np.random.default_rng(4).normal(0, noise, 600), np.ones(600))
    at = scatter(500, 6)
    rms = [
        float(
            np.sqrt(np.mean(angle_difference(smooth_samples(samples, SHAPE, 25.0, 50.0, n).at(at), 0.3) ** 2))
        )
        for n in (1, 2)
    ]
    assert 1.2 * rms[0] < rms[1] < 3 * rms[0]


def test_noise_is_averaged_within_bounds_on_both_sides() -> None:
    rng = np.random.default_rng(4)
    points, noise = scatter(600, 5), np.radians(1.0)
    samples = FlowSamples(points, 0.3 + rng.normal(0, noise, 600), np.ones(600))
    field = smooth_samples(samples, SHAPE, 25.0, 50.0)
    error = angle_difference(field.at(scatter(500, 6)), 0.3)
    rms = float(np.sqrt(np.mean(error**2)))
    # About 4 pi sigma^2 N / area = 70 samples count at a place: their mean has an eighth of the noise.
    assert rms < 0.3 * noise


def test_weights_are_heeded() -> None:
    points = np.repeat(scatter(60, 7), 2, axis=0)
    angles, weights = np.tile([0.2, 0.6], 60), np.tile([1.0, 0.01], 60)
    field = smooth_samples(FlowSamples(points, angles, weights), SHAPE, 30.0, 60.0)
    assert np.abs(field.at(points) - 0.2).max() < 0.02


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("count", [1, 3, 30])
def test_far_from_all_samples_the_field_is_finite_and_like_the_nearest(count: int) -> None:
    points = np.random.default_rng(9).uniform(5, 15, (count, 2))
    samples = FlowSamples(points, np.full(count, -0.4), np.ones(count))
    field = smooth_samples(samples, (4000, 3000), 60.0, 20.0)
    assert np.isfinite(field.doubled).all()
    far = np.array([[2999.0, 3999.0], [0.0, 3999.0], [1500.0, 2000.0]])
    assert np.abs(angle_difference(field.at(far), -0.4)).max() < 1e-3


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (20, 20), (1, 500)])
def test_tiny_images_have_fields(shape: tuple[int, int]) -> None:
    samples = FlowSamples(np.zeros((2, 2)), np.array([0.1, 0.1]), np.ones(2))
    field = smooth_samples(samples, shape, 30.0, 10.0)
    assert field.at(np.zeros((1, 2)))[0] == pytest.approx(0.1, abs=1e-3)


@pytest.mark.filterwarnings("error")
def test_no_samples_make_a_level_field() -> None:
    nothing = FlowSamples(np.zeros((0, 2)), np.zeros(0), np.zeros(0))
    field = smooth_samples(nothing, SHAPE, 30.0, 50.0)
    assert np.abs(field.at(scatter(20))).max() < 1e-6
    assert len(reject_outliers(nothing, 50.0, SHAPE, 0.1)) == 0


@pytest.mark.parametrize("seed", range(4))
def test_outliers_go_and_the_others_stay(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = scatter(400, seed)
    angles = 0.1 + 0.0004 * points[:, 0] + rng.normal(0, np.radians(0.3), 400)
    wrong = rng.random(400) < 0.12
    angles[wrong] += rng.choice([-1, 1], wrong.sum()) * rng.uniform(
        np.radians(20), np.radians(80), wrong.sum()
    )
    samples = FlowSamples(points, angles, np.ones(400))
    kept = reject_outliers(samples, 40.0, SHAPE, np.radians(8.0))
    good = {tuple(p) for p in points[~wrong]}
    found = {tuple(p) for p in kept.points}
    assert not found - good
    assert len(found) > 0.97 * len(good)


def test_nothing_is_rejected_where_all_agree() -> None:
    samples = FlowSamples(scatter(50), np.full(50, np.pi / 2), np.ones(50))
    assert len(reject_outliers(samples, 40.0, SHAPE, np.radians(8.0))) == 50


@given(st.floats(0.2, 5.0))
@settings(max_examples=20)
def test_resized_field_shows_the_same_directions(factor: float) -> None:
    field, points = smooth_field(3), scatter(80, 8)
    resized = resize_field(field, factor).at((points + 0.5) * factor - 0.5)
    assert np.abs(angle_difference(resized, field.at(points))).max() < 0.2 / 16


def test_samples_are_selected_whole() -> None:
    samples = FlowSamples(scatter(5), np.arange(5.0), np.arange(5.0) / 5)
    chosen = samples.select(np.array([True, False, False, True, False]))
    assert len(chosen) == 2
    assert chosen.angles.tolist() == [0.0, 3.0]
    assert np.array_equal(chosen.points, samples.points[[0, 3]])
    assert chosen.weights.tolist() == [0.0, 0.6]


def test_directions_at_pixels_are_those_at_points() -> None:
    field = smooth_samples(
        FlowSamples(scatter(60), np.random.default_rng(2).uniform(-1, 1, 60), np.ones(60)), SHAPE, 17.3, 90.0
    )
    pixels = np.random.default_rng(3).integers(0, [[SHAPE[1]], [SHAPE[0]]], (2, 9000))
    assert np.array_equal(field.at_pixels(pixels), field.at(pixels.T.astype(np.float32)))
    assert field.at_pixels(pixels[:, :0]).shape == (0,)


def test_what_no_outlier_is_in_is_judged_once(monkeypatch: pytest.MonkeyPatch) -> None:
    fields: list[FlowField] = []

    def smooth(*arguments: object) -> FlowField:
        fields.append(smooth_samples(*arguments))  # type: ignore[arg-type]
        return fields[-1]

    monkeypatch.setattr("services.texture_flow.regression.smooth_samples", smooth)
    straight = FlowSamples(scatter(60), np.full(60, 0.1), np.ones(60))
    assert len(reject_outliers(straight, 90.0, SHAPE, 0.1)) == 60
    assert len(fields) == 1
