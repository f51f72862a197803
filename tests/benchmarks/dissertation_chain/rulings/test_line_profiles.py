"""Curve-based profiles over synthetic ink."""

import numpy as np
import pytest

from benchmarks.dissertation_chain.rulings.line_profiles import (
    InkImage,
    LineProfiles,
    find_line_edges,
    follow_flow,
    measure_line_profiles,
    principal_wave_lengths,
)


def test_paths_follow_circles():
    start = np.array([[1.0, 0.0], [0.0, 0.5], [-2.0, 0.0]])
    paths = follow_flow(lambda p: np.arctan2(p[:, 0], -p[:, 1]), start, 0.05, 12)
    assert paths.shape == (3, 25, 2)
    np.testing.assert_allclose(paths[:, 12], start)
    radius = np.linalg.norm(paths, axis=2)
    np.testing.assert_allclose(radius, np.linalg.norm(start, axis=1)[:, None] * np.ones(25), rtol=2e-3)
    step = np.linalg.norm(np.diff(paths, axis=1), axis=2)
    np.testing.assert_allclose(step, 0.05, rtol=1e-6)


def test_paths_go_on_where_the_flow_turns_its_sign_or_is_unknown():
    paths = follow_flow(lambda p: np.where(p[:, 0] > 0.1, np.pi, 0.0), np.zeros((1, 2)), 0.05, 8)
    np.testing.assert_allclose(paths[0, :, 0], np.linspace(-0.4, 0.4, 17), atol=1e-12)
    unknown = follow_flow(lambda p: np.where(p[:, 0] > 0.1, np.nan, 0.0), np.zeros((1, 2)), 0.05, 8)
    np.testing.assert_allclose(unknown, paths, atol=1e-12)


BEND = 0.3
SCALE, CENTRE = 400.0, (399.5, 399.5)


def curved_lines(spacing):
    """Text lines of height 0.45 `spacing` along y = BEND x^2 + k spacing, as ink of an 800 x 800 image."""
    y, x = (np.mgrid[0:800, 0:800] - 399.5) / SCALE
    return ((((y - BEND * x**2) / spacing) % 1.0) < 0.45).astype(np.float32)


def bent_flow(points):
    return np.arctan(2 * BEND * points[:, 0])


@pytest.mark.parametrize("x", [0.0, 0.5])
def test_a_curved_line_falls_on_one_place_of_the_profile(x):
    spacing = 0.06
    ink = InkImage(curved_lines(spacing), SCALE, CENTRE)
    points, angles = np.array([[x, 0.0]]), np.array([np.pi / 2])
    profiles = measure_line_profiles(ink, bent_flow, points, angles, (-0.6, 0.6), 0.03)
    assert profiles.profiles.max() > 0.95
    assert profiles.profiles.min() < 0.05
    assert abs(profiles.wave_lengths[0] / spacing - 1) < 0.02
    edges = find_line_edges(profiles)[0]
    tops = edges.tops[(edges.tops > -0.5) & (edges.tops < 0.5)]
    bottoms = edges.bottoms[(edges.bottoms > -0.5) & (edges.bottoms < 0.5)]
    # Where y = BEND x^2 + k spacing, and 0.45 of a spacing below: sub-sample, sub-pixel.
    phase = (tops - BEND * x**2) / spacing
    assert np.abs(phase - np.round(phase)).max() < 0.04
    phase = (bottoms - BEND * x**2) / spacing - 0.45
    assert np.abs(phase - np.round(phase)).max() < 0.04
    assert len(tops) in (16, 17)


def test_straight_paths_blur_what_curved_ones_resolve():
    ink = InkImage(curved_lines(0.06), SCALE, CENTRE)
    points, angles = np.array([[0.5, 0.0]]), np.array([np.pi / 2])
    curved = measure_line_profiles(ink, bent_flow, points, angles, (-0.6, 0.6), 0.03)
    straight = measure_line_profiles(ink, lambda p: np.zeros(len(p)), points, angles, (-0.6, 0.6), 0.03)
    assert curved.profiles.std() > 1.5 * straight.profiles.std()


def test_wave_lengths_of_cosines_are_found_and_blank_profiles_have_none():
    places = np.linspace(-0.5, 0.5, 600)
    step = places[1] - places[0]
    wave = np.array([0.05, 0.056])
    profiles = np.cos(2 * np.pi * places / wave[:, None])
    np.testing.assert_allclose(principal_wave_lengths(profiles, step, 0.025), wave, rtol=0.02)
    assert np.all(principal_wave_lengths(np.zeros((2, 600)), step, 0.025) == 0)


def test_blank_and_constant_profiles_have_no_edges():
    places = np.linspace(-0.5, 0.5, 300)
    for value in (0.0, 1.0):
        profiles = LineProfiles(np.full((1, 300), value), places, places[1] - places[0], np.array([0.05]))
        edges = find_line_edges(profiles)[0]
        assert len(edges.tops) == len(edges.bottoms) == 0
