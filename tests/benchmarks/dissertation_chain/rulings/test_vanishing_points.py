"""Vanishing points from line spacing: exact profiles, noise, wrong lines, and photos."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.dissertation_chain.rulings.line_profiles import InkImage, LineEdges
from benchmarks.dissertation_chain.rulings.page_rulings import find_page_rulings
from benchmarks.dissertation_chain.rulings.results import RulingVanishingPoints
from benchmarks.dissertation_chain.rulings.vanishing_points import (
    SpacingParameters,
    estimate_ruling_vanishing_points,
    find_paragraphs,
    fit_line_spacing,
    share_with_neighbours,
)
from services.texture_flow.field import FlowSamples


def seen(u, w):
    """Places on the ruling of lines at u on the page: the inverse of u = p / (1 - w p)."""
    return u / (1 + w * u)


def page_edges(w, spacing=0.03, paragraphs=(8, 6, 10, 7), gap=1.5, noise=0.0, rng=None, leading=None):
    """Tops and bottoms of paragraphs set apart by `gap` lines, symmetric about the reference point."""
    starts = np.cumsum([0.0] + [n - 1 + gap for n in paragraphs[:-1]])
    leadings = np.ones(len(paragraphs)) if leading is None else np.array(leading)
    u = np.concatenate(
        [s + lead * np.arange(n) for s, n, lead in zip(starts, paragraphs, leadings, strict=True)]
    )
    u = spacing * (u - u.mean())
    tops, bottoms = seen(u, w), seen(u + 0.5 * spacing, w)
    if rng is not None:
        tops = tops + rng.normal(0.0, noise * spacing, len(tops))
        bottoms = bottoms + rng.normal(0.0, noise * spacing, len(bottoms))
    return LineEdges(np.sort(tops), np.sort(bottoms))


@pytest.mark.parametrize("w", [0.0, 0.4, -0.7, 0.05])
def test_exact_spacing_gives_the_exact_vanishing_point(w):
    fit = fit_line_spacing(page_edges(w))
    assert abs(fit.inverse_place - w) < 1e-6
    assert fit.edges == 62


def test_lines_of_a_paragraph_have_the_cross_ratio_of_one_quarter():
    edges = page_edges(0.5)
    runs = find_paragraphs(edges.tops, 0.045)
    assert [len(run) for run in runs] == [8, 6, 10, 7]
    np.testing.assert_allclose(np.concatenate(runs), edges.tops)


@pytest.mark.parametrize("places", [np.zeros(0), np.arange(3.0), np.array([0.0, 1.0, 3.0, 3.5, 7.0, 7.1])])
def test_uneven_or_few_lines_are_no_paragraph(places):
    assert find_paragraphs(places, 0.045) == []


def test_the_deviation_tells_the_error():
    rng = np.random.default_rng(1)
    errors, told = [], []
    for _ in range(60):
        w = rng.uniform(-0.5, 0.5)
        fit = fit_line_spacing(page_edges(w, noise=0.04, rng=rng))
        errors.append((fit.inverse_place - w) / fit.deviation)
        told.append(fit.deviation)
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.6
    assert 0.0005 < np.median(told) < 0.02


def test_another_leading_and_stray_edges_hardly_matter():
    rng = np.random.default_rng(2)
    edges = page_edges(0.3, leading=(1.0, 1.0, 1.0, 1.35), noise=0.01, rng=rng)
    stray = LineEdges(
        np.sort(np.append(np.delete(edges.tops, 12), rng.uniform(-0.4, 0.4, 2))), np.delete(edges.bottoms, 20)
    )
    assert abs(fit_line_spacing(stray).inverse_place - 0.3) < 0.03


@settings(max_examples=30)
@given(st.floats(0.2, 5.0), st.floats(-0.6, 0.6))
def test_the_vanishing_point_scales_with_the_photo(scale, w):
    edges = page_edges(w)
    scaled = fit_line_spacing(LineEdges(edges.tops * scale, edges.bottoms * scale))
    assert abs(scaled.inverse_place * scale - w) < 1e-4


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.integers(0, 60))
def test_random_edges_give_finite_answers(seed, count):
    rng = np.random.default_rng(seed)
    edges = LineEdges(np.sort(rng.uniform(-1, 1, count)), np.sort(rng.normal(0, 1e-3, count)))
    fit = fit_line_spacing(edges)
    assert np.isfinite(fit.inverse_place)
    assert fit.deviation > 0


def test_too_few_lines_have_no_vanishing_point():
    fit = fit_line_spacing(page_edges(0.3, paragraphs=(4,)))
    assert fit.deviation == np.inf
    none = LineEdges(np.zeros(0), np.zeros(0))
    found = estimate_ruling_vanishing_points([none] * 3, np.zeros((3, 2)), np.full(3, 1.2))
    assert np.all(np.isinf(found.deviations))
    # They are given the ruling's own direction: at infinity.
    np.testing.assert_allclose(found.directions, np.tile([np.cos(1.2), np.sin(1.2), 0.0], (3, 1)))


def fan(vanishing, count=12):
    """Rulings through one vanishing point, with the exact edges along each."""
    points = np.column_stack([np.linspace(-0.4, 0.4, count), np.zeros(count)])
    to = vanishing - points
    angles = np.arctan2(to[:, 1], to[:, 0])
    edges = [page_edges(1 / distance) for distance in np.linalg.norm(to, axis=1)]
    return points, angles, edges


def test_rulings_of_a_cylinder_share_their_vanishing_point():
    vanishing = np.array([0.3, 2.5])
    points, angles, edges = fan(vanishing)
    # One ruling sees too few lines, one a chance fit far off: both take their neighbours'.
    edges[4] = LineEdges(np.zeros(0), np.zeros(0))
    edges[8] = page_edges(-0.9, paragraphs=(6,))
    found = estimate_ruling_vanishing_points(edges, points, angles)
    expected = np.append(vanishing, 1.0) / np.linalg.norm(np.append(vanishing, 1.0))
    off = np.degrees(np.linalg.norm(np.cross(found.directions, expected), axis=1))
    assert off.max() < 0.3
    assert np.all(np.degrees(found.deviations) < 1.0)
    np.testing.assert_allclose(np.linalg.norm(found.directions, axis=1), 1.0)


def test_shared_vanishing_points_stay_on_their_rulings():
    rng = np.random.default_rng(3)
    points, angles, _ = fan(np.array([0.3, 2.5]))
    found = RulingVanishingPoints(
        np.column_stack([np.cos(angles), np.sin(angles), rng.normal(0, 0.2, 12)]), np.full(12, 0.05)
    )
    shared = share_with_neighbours(found, points, angles, SpacingParameters())
    normal = np.column_stack(
        [-np.sin(angles), np.cos(angles), points[:, 0] * np.sin(angles) - points[:, 1] * np.cos(angles)]
    )
    np.testing.assert_allclose(np.einsum("nx,nx->n", shared.directions, normal), 0.0, atol=1e-12)


def page_rulings_of(shot):
    analysis, frame = shot.analysis, shot.frame
    centre = np.array(frame.centre)
    reduced = (centre + 0.5) * analysis.factor - 0.5
    ink = InkImage(
        analysis.text.ink.astype(np.float32),
        frame.unit_px * analysis.factor,
        (float(reduced[0]), float(reduced[1])),
    )
    return find_page_rulings(
        shot.major,
        shot.minor,
        (analysis.characters - centre) / frame.unit_px,
        analysis.text_height_px / frame.unit_px,
        ink,
    )


@pytest.mark.parametrize("name", ["book", "bent"])
def test_rulings_of_photos_point_the_right_way_in_space(album, name):
    shot = album[name]
    found = page_rulings_of(shot)
    truth, frame = shot.truth, shot.frame
    at = found.projected.points * frame.unit_px + frame.centre
    expected = truth.rulings_3d(at)
    focal = truth.focal_length_px / frame.unit_px
    direction = found.vanishing_points.directions * [1.0, 1.0, focal]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    known = np.isfinite(found.vanishing_points.deviations)
    off = np.degrees(np.linalg.norm(np.cross(direction, expected), axis=1))[known]
    assert known.mean() > 0.8
    # The dissertation's mean error of 3D rulings is 2.91 degrees.
    assert off.mean() < 2.0


def test_a_page_without_ink_or_strokes_is_told_to_be_unknown():
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (60, 2))
    samples = FlowSamples(points, np.zeros(60), np.ones(60))
    blank = InkImage(np.zeros((80, 80), np.float32), 60.0, (39.5, 39.5))
    found = find_page_rulings(samples, None, points, 0.02, blank)
    assert np.all(np.isinf(found.vanishing_points.deviations))
    assert not found.projected.curved.any()
    nothing = find_page_rulings(samples.select(np.zeros(60, bool)), None, np.zeros((0, 2)), 0.02, blank)
    assert np.all(np.isfinite(nothing.projected.angles))
