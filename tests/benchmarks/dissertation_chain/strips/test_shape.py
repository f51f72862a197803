"""The whole estimation: exact on exact data, near the truth under noise, steady under whatever comes."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.dissertation_chain.strips.constraints import unit
from benchmarks.dissertation_chain.strips.evidence import StripEvidence
from benchmarks.dissertation_chain.strips.initial import FocalKnowledge
from benchmarks.dissertation_chain.strips.optimization import (
    OptimizationParameters,
    optimize_shape,
    soft_l1_of_first,
)
from benchmarks.dissertation_chain.strips.shape import estimate_strip_shape
from tests.benchmarks.dissertation_chain.strips.bent_page import BentPage, angles_between_deg, disturbed

TYPICAL = FocalKnowledge(float(np.log(1.29)), 0.25)
PAGES = [
    BentPage(),
    BentPage(focal=1.6, azimuth_rad=2.5, skew_rad=0.25),
    BentPage(focal=1.1, radius=-1.0, azimuth_rad=4.5, tilt_rad=0.4, skew_rad=-0.25),
]


def half_field_of_view_deg(focal: float) -> float:
    return float(np.degrees(np.arctan(1 / focal)))


def turned(evidence: StripEvidence, angle: float) -> StripEvidence:
    """The same photo, turned about its centre."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    v = evidence.vanishing_points
    return replace(
        evidence,
        reference_points=evidence.reference_points @ turn,
        rulings=evidence.rulings @ turn,
        vanishing_points=np.column_stack([v[:, :2] @ turn, v[:, 2]]),
        points=evidence.points @ turn,
        major=evidence.major @ turn,
        minor=evidence.minor @ turn,
    )


@pytest.mark.parametrize("page", PAGES)
def test_exact_data_give_the_exact_shape(page: BentPage) -> None:
    shape = estimate_strip_shape(page.evidence(20), TYPICAL)
    assert abs(half_field_of_view_deg(shape.focal) - half_field_of_view_deg(page.focal)) < 0.4
    assert angles_between_deg(shape.normals, page.normals(page.strip_middles(20))).max() < 0.4
    assert shape.converged


def test_noise_moves_the_shape_a_little_and_the_optimization_brings_it_nearer() -> None:
    errors = []
    for page, seed in itertools.product(PAGES, range(3)):
        evidence = disturbed(page.evidence(20), np.random.default_rng(seed), np.radians(0.7))
        shape = estimate_strip_shape(evidence, TYPICAL)
        truth = page.normals(page.strip_middles(20))
        errors.append(
            [
                angles_between_deg(shape.initial_normals, truth).mean(),
                angles_between_deg(shape.normals, truth).mean(),
                abs(half_field_of_view_deg(shape.focal) - half_field_of_view_deg(page.focal)),
            ]
        )
    initial, final, view = np.mean(errors, axis=0)
    assert final < 1.2
    assert final < initial
    assert view < 1.5


def test_a_wrong_start_ends_at_the_truth() -> None:
    page = BentPage()
    evidence = page.evidence(20)
    truth = page.normals(page.strip_middles(20))
    rng = np.random.default_rng(2)
    start = unit(truth + rng.normal(0, 0.15, truth.shape))
    found = optimize_shape(evidence, start, 1.6, TYPICAL)
    assert angles_between_deg(found.normals, truth).max() < 0.5
    assert found.evaluations <= 20


def test_wild_samples_are_outvoted() -> None:
    page = BentPage()
    evidence = page.evidence(20)
    major, minor = evidence.major.copy(), evidence.minor.copy()
    wild = np.random.default_rng(5).random(major.shape[:2]) < 0.1
    major[wild] = major[wild] @ [[0.8, 0.6], [-0.6, 0.8]]
    minor[wild] = minor[wild] @ [[0.9, -0.436], [0.436, 0.9]]
    shape = estimate_strip_shape(replace(evidence, major=major, minor=minor), TYPICAL)
    assert angles_between_deg(shape.normals, page.normals(page.strip_middles(20))).mean() < 2.5


def test_a_fixed_focal_length_stays() -> None:
    page = BentPage()
    shape = estimate_strip_shape(
        page.evidence(), FocalKnowledge(float(np.log(page.focal)), 0.003, fixed=True)
    )
    assert shape.focal == shape.initial_focal == pytest.approx(page.focal)
    assert angles_between_deg(shape.normals, page.normals(page.strip_middles(12))).max() < 0.3


@settings(max_examples=6, deadline=None)
@given(st.floats(-1.0, 1.0), st.integers(0, 100))
def test_a_turned_photo_shows_the_same_page(angle: float, seed: int) -> None:
    page = BentPage(skew_rad=0.1)
    evidence = disturbed(page.evidence(10), np.random.default_rng(seed), 0.01)
    straight, tilted = (estimate_strip_shape(e, TYPICAL) for e in (evidence, turned(evidence, angle)))
    c, s = np.cos(angle), np.sin(angle)
    back = tilted.normals @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    assert angles_between_deg(straight.normals, back).max() < 0.5
    assert tilted.focal == pytest.approx(straight.focal, rel=0.02)


def test_reference_points_lie_on_their_lines_of_sight_and_on_both_strips() -> None:
    page = BentPage()
    shape = estimate_strip_shape(page.evidence(), TYPICAL)
    P = shape.reference_points_3d
    np.testing.assert_allclose(shape.focal * P[:, :2] / P[:, 2:], shape.reference_points, atol=1e-12)
    assert P[0, 2] == pytest.approx(shape.focal)
    assert np.abs(np.einsum("na,na->n", np.diff(P, axis=0), shape.normals)).max() < 1e-12


def test_vanishing_points_of_the_found_rulings_are_those_of_the_page() -> None:
    page = BentPage()
    evidence = page.evidence()
    shape = estimate_strip_shape(evidence, TYPICAL)
    agreement = np.abs(np.einsum("na,na->n", shape.vanishing_points, evidence.vanishing_points))
    assert np.degrees(np.arccos(agreement.clip(max=1))).max() < 0.5


def test_without_minor_flow_a_known_lens_still_gives_the_shape() -> None:
    page = BentPage()
    evidence = replace(page.evidence(20), minor_weights=np.zeros((20, 8)))
    shape = estimate_strip_shape(evidence, FocalKnowledge(float(np.log(page.focal)), 0.003, fixed=True))
    assert angles_between_deg(shape.normals, page.normals(page.strip_middles(20))).mean() < 3.0


def test_without_vanishing_points_flows_give_the_shape() -> None:
    page = BentPage()
    evidence = page.evidence(20)
    evidence = replace(
        evidence,
        vanishing_deviations=np.full(21, np.inf),
        vanishing_points=np.tile([0.0, 1.0, 0.0], (21, 1)),
    )
    shape = estimate_strip_shape(evidence, TYPICAL)
    assert angles_between_deg(shape.normals, page.normals(page.strip_middles(20))).mean() < 1.5


@pytest.mark.parametrize("page", [BentPage(tilt_rad=0.0), BentPage(radius=np.inf), BentPage(azimuth_rad=0.0)])
def test_rulings_without_perspective_are_no_obstacle(page: BentPage) -> None:
    """Vanishing points at infinity, flat pages: the focal length is that of the typical camera, or nearly."""
    shape = estimate_strip_shape(page.evidence(), TYPICAL)
    assert abs(np.log(shape.focal) - np.log(page.focal)) < 0.5
    assert angles_between_deg(shape.normals, page.normals(page.strip_middles(12))).mean() < 4.0


def test_one_strip_is_a_plane() -> None:
    page = BentPage(radius=np.inf)
    shape = estimate_strip_shape(
        page.evidence(1), FocalKnowledge(float(np.log(page.focal)), 0.01, fixed=True)
    )
    assert angles_between_deg(shape.normals, page.normals(np.zeros(1))).max() < 1.0


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 8))
def test_any_directions_end_in_finite_normals_within_the_limit(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    evidence = disturbed(BentPage().evidence(count, 4), rng, 1.0)
    vanishing = unit(rng.normal(size=(count + 1, 3)))
    weights = rng.random((count, 4)) * rng.integers(0, 2, (count, 1))
    evidence = replace(evidence, vanishing_points=vanishing, major_weights=weights, minor_weights=weights)
    shape = estimate_strip_shape(evidence, TYPICAL)
    assert shape.evaluations <= OptimizationParameters().evaluations
    np.testing.assert_allclose(np.linalg.norm(shape.normals, axis=1), 1.0)
    assert 0.04 < shape.focal < 21
    for values in (shape.vanishing_points, shape.reference_points_3d, shape.objective):
        assert np.all(np.isfinite(values))


def test_the_loss_grows_slowly_for_measurements_only() -> None:
    loss = soft_l1_of_first(1, np.array([3.0, 3.0]))
    np.testing.assert_allclose(loss, [[2.0, 3.0], [0.5, 1.0], [-0.5 / 8, 0.0]])
