"""Chords, order and reference points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.dissertation_chain.rulings.reference_points import (
    choose_reference_points,
    clip_to_hull,
    crossings_inside,
    follow_in_order,
    keep_dense_text,
)
from services.geometry.hulls import text_hull

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def test_chords_of_a_square_end_on_its_sides():
    points = np.array([[0.0, 0.0], [0.5, 0.0], [3.0, 0.0]])
    angles = np.array([[np.pi / 2, np.pi / 4], [np.pi / 2, np.pi / 4], [np.pi / 2, 0.0]])
    chords = clip_to_hull(SQUARE, points, angles)
    np.testing.assert_allclose(chords.high[0], [1.0, np.sqrt(2)])
    np.testing.assert_allclose(chords.low[1], [-1.0, -np.sqrt(2)])
    np.testing.assert_allclose([chords.low[2, 0], chords.high[2, 0]], [0.0, 0.0])
    np.testing.assert_allclose([chords.low[2, 1], chords.high[2, 1]], [-4.0, -2.0])


@pytest.mark.parametrize("angle", np.radians([0.0, 40.0, 90.0, 135.0]))
def test_reference_points_cover_the_text_and_end_just_outside(angle):
    points = choose_reference_points(SQUARE, np.array([0.2, 0.1]), angle, 20)
    across = np.array([np.sin(angle), -np.cos(angle)])
    places, reach = points @ across, SQUARE @ across
    places = np.sort(places)
    gap = np.diff(places)
    np.testing.assert_allclose(gap, gap[0])
    assert reach.min() - gap[0] < places[0] < reach.min() < places[1]
    assert places[-2] < reach.max() < places[-1] < reach.max() + gap[0]


def test_neighbours_are_in_order_just_where_their_chords_do_not_cross():
    rng = np.random.default_rng(4)
    points = choose_reference_points(SQUARE, np.zeros(2), np.pi / 2, 8)
    angles = np.pi / 2 + rng.uniform(-0.7, 0.7, (8, 15))
    allowed = follow_in_order(SQUARE, points, angles)
    assert 0.1 < allowed.mean() < 0.9
    for i in range(1, 6):
        for j in range(15):
            for k in range(15):
                pair = np.array([angles[i, j], angles[i + 1, k]])
                crossing = crossings_inside(SQUARE, points[i : i + 2], pair)
                assert allowed[i, j, k] == (crossing == 0)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.0, np.pi), st.integers(0, 10_000))
def test_parallel_rulings_are_always_in_order(angle, seed):
    rng = np.random.default_rng(seed)
    hull = text_hull(rng.normal(0.0, 0.4, (30, 2)))
    points = choose_reference_points(hull, hull.mean(axis=0), angle, 12)
    angles = np.full((12, 1), angle)
    assert follow_in_order(hull, points, angles).all()


def test_marks_far_from_all_text_do_not_stretch_the_hull():
    rng = np.random.default_rng(5)
    text = np.concatenate([rng.uniform(-0.5, 0.5, (400, 2)), [[3.0, 3.0], [-2.0, 1.0]]])
    kept = keep_dense_text(text, 0.15)
    assert len(kept) == 400
    assert text_hull(kept).max() < 0.52


@pytest.mark.parametrize("count", [1, 2, 5])
def test_few_points_have_a_hull(count):
    hull = text_hull(np.linspace(0.0, 1.0, count)[:, None] * np.array([[1.0, 0.0]]))
    assert len(hull) >= 3
    assert np.all(np.isfinite(hull))
