"""Projected rulings against the truth of simulated pages, with exact, noisy and measured flows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.dissertation_chain.flow_regression import regress_flow
from benchmarks.dissertation_chain.rulings.projected import detect_projected_rulings
from benchmarks.dissertation_chain.rulings.reference_points import (
    chord_ends,
    clip_to_hull,
    crossings_inside,
    keep_dense_text,
)
from services.geometry.hulls import text_hull
from services.texture_flow.field import angle_difference
from tests.benchmarks.dissertation_chain.rulings.worlds import SHAPES, World, noisy


def ruling_errors_deg(found, text, rulings_at):
    """Mean error (deg) of every ruling that crosses the text, along its part in the text."""
    chords = clip_to_hull(text_hull(text), found.points, found.angles[:, None])
    ends = chord_ends(found.points, found.angles[:, None], chords)[:, 0]
    crossing = (chords.high - chords.low)[:, 0] > 0.05
    share = np.linspace(0.05, 0.95, 9)[:, None]
    errors = [
        np.abs(angle_difference(np.full(9, angle), rulings_at(a + share * (b - a)))).mean()
        for angle, (a, b) in zip(found.angles[crossing], ends[crossing], strict=True)
    ]
    return np.degrees(errors)


@pytest.mark.parametrize(
    ("shape", "pose", "skew_deg"),
    [(shape, *((0, 0.0), (2, 15.0), (0, -15.0))[k % 3]) for k, shape in enumerate(SHAPES)],
)
def test_exact_flows_give_exact_rulings(shape, pose, skew_deg):
    world = World(shape, pose, skew_deg)
    found = detect_projected_rulings(world.major, world.text, world.minor)
    errors = ruling_errors_deg(found, world.text, world.rulings)
    assert len(errors) >= 22
    assert errors.mean() < (0.3 if shape in ("book", "wave") else 0.8)


@pytest.mark.parametrize("skew_deg", [60.0, 90.0])
def test_strokes_witness_where_text_runs_along_the_rulings(skew_deg):
    world = World("book", 0, skew_deg)
    found = detect_projected_rulings(world.major, world.text, world.minor)
    assert ruling_errors_deg(found, world.text, world.rulings).mean() < 0.5
    if skew_deg == 90.0:
        # The case that the dissertation leaves open cannot be solved from the major flow alone.
        alone = detect_projected_rulings(world.major, world.text)
        assert ruling_errors_deg(alone, world.text, world.rulings).mean() > 20.0


def test_noise_moves_the_rulings_in_proportion():
    errors = {}
    for deviation in (0.1, 0.4):
        means = []
        for k, shape in enumerate(("book", "wave")):
            world = World(shape, 2, 15.0)
            major, minor = noisy(world.major, deviation, k), noisy(world.minor, 2 * deviation, k + 9)
            found = detect_projected_rulings(major, world.text, minor)
            means.append(ruling_errors_deg(found, world.text, world.rulings).mean())
        errors[deviation] = float(np.mean(means))
    assert errors[0.1] < 1.0
    assert errors[0.1] < errors[0.4] < 3.0


def test_qualities_are_small_along_true_rulings_and_curved_parts_are_told():
    world = World("wave", 0, 0.0)
    found = detect_projected_rulings(world.major, world.text, world.minor)
    assert np.degrees(found.qualities[1:-1].max()) < 0.1
    assert found.curved.mean() > 0.5


def test_flat_pages_show_no_ruling_of_their_own():
    text = World("book").text
    found = detect_projected_rulings(
        lambda p: np.arctan2(0.5 - p[:, 1], 4.0 - p[:, 0]), text, lambda p: np.arctan2(5 - p[:, 1], -p[:, 0])
    )
    assert not found.curved.any()
    assert crossings_inside(text_hull(text), found.points, found.angles) == 0


def turned(directions, angle):
    c, s = np.cos(angle), np.sin(angle)
    return lambda points: directions(points @ np.array([[c, -s], [s, c]])) + angle


@settings(max_examples=3, deadline=None)
@given(st.floats(-1.0, 1.0))
def test_rulings_turn_with_the_photo(angle):
    world = World("book", 2, 15.0)
    c, s = np.cos(angle), np.sin(angle)
    text = world.text @ np.array([[c, s], [-s, c]])
    found = detect_projected_rulings(turned(world.major, angle), text, turned(world.minor, angle))
    errors = ruling_errors_deg(found, text, turned(world.rulings, angle))
    assert errors.mean() < 0.3


def random_flow(seed):
    rng = np.random.default_rng(seed)
    waves, phases = rng.normal(0.0, 4.0, (6, 2)), rng.uniform(0.0, 2 * np.pi, 6)
    return lambda p: np.cos(p @ waves.T + phases).sum(axis=1)


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_rulings_never_cross_inside_the_text_whatever_the_flows(seed, with_minor):
    rng = np.random.default_rng(seed)
    text = rng.uniform(-0.6, 0.6, (rng.integers(5, 300), 2))
    found = detect_projected_rulings(random_flow(seed), text, random_flow(seed + 1) if with_minor else None)
    hull = text_hull(keep_dense_text(text, 0.12))
    assert crossings_inside(hull, found.points, found.angles) == 0
    assert np.all((found.angles >= 0) & (found.angles < np.pi))
    assert np.all(np.isfinite(found.qualities))


@pytest.mark.parametrize("count", [0, 1, 2, 40])
@pytest.mark.parametrize("spread", [0.0, 1.0])
def test_degenerate_text_gives_finite_rulings(count, spread):
    text = np.linspace(-0.5, 0.5, count)[:, None] * np.array([[1.0, 0.0]]) * spread
    for flow in (lambda p: np.zeros(len(p)), lambda p: np.full(len(p), np.nan)):
        found = detect_projected_rulings(flow, text, flow)
        assert np.all(np.isfinite(found.points))
        assert np.all(np.isfinite(found.angles))
        assert np.all(np.isfinite(found.qualities))


@pytest.mark.parametrize("name", ["book", "bent"])
def test_measured_flows_of_photos(album, name):
    shot = album[name]
    height = shot.analysis.text_height_px / shot.frame.unit_px
    text = (shot.analysis.characters - shot.frame.centre) / shot.frame.unit_px
    major = regress_flow(shot.major, 4 * height)
    minor = regress_flow(shot.minor, 6 * height)
    found = detect_projected_rulings(major.at, text, minor.at, major.trust_at)

    def rulings_at(points):
        return shot.truth.rulings(points * shot.frame.unit_px + shot.frame.centre)

    errors = ruling_errors_deg(found, keep_dense_text(text, 0.12), rulings_at)
    # The dissertation has 1.82 degrees.
    assert errors.mean() < 1.5
