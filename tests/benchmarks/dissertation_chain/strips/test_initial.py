"""Dynamic programming finds what trying everything finds; the cubic finds the focal length."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.dissertation_chain.strips.constraints import Deviations, unit
from benchmarks.dissertation_chain.strips.initial import (
    COARSE_DEVIATIONS,
    FocalKnowledge,
    InitialParameters,
    cost_tables,
    estimate_initial_shape,
    least_of_cubic,
    least_path,
    ruling_directions,
    search_normals,
)
from tests.benchmarks.dissertation_chain.strips.bent_page import BentPage, angles_between_deg

WIDE = FocalKnowledge(float(np.log(1.3)), 0.5)


def test_dynamic_programming_equals_brute_force() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        unary, pairwise = rng.random((4, 3)), rng.random((3, 3, 3))

        def cost(path: tuple[int, ...], unary: np.ndarray = unary, pairwise: np.ndarray = pairwise) -> float:
            alone = sum(unary[k, c] for k, c in enumerate(path))
            return float(alone + sum(pairwise[k, a, b] for k, (a, b) in enumerate(itertools.pairwise(path))))

        best = min(itertools.product(range(3), repeat=4), key=cost)
        path, least = least_path(unary, pairwise)
        assert tuple(path) == best
        assert least == pytest.approx(cost(best))


def test_one_strip_takes_its_own_best() -> None:
    path, least = least_path(np.array([[3.0, 1.0, 2.0]]), np.zeros((0, 3, 3)))
    assert (path.tolist(), least) == ([1], 1.0)


@pytest.mark.parametrize(
    ("y", "expected"),
    [
        (lambda x: (x - 0.3) ** 2 * (1 + 0.1 * x), 0.3),
        (lambda x: x, -2.0),
        (lambda x: -x, 2.0),
        (lambda x: 1 - np.exp(-((x + 0.4) ** 2) / 2), -0.4),
    ],
)
def test_the_cubic_finds_the_minimum(y, expected: float) -> None:
    x = np.linspace(-2, 2, 9)
    assert least_of_cubic(x, y(x)) == pytest.approx(expected, abs=0.06)


def test_costs_are_least_at_the_true_normals() -> None:
    page = BentPage(skew_rad=0.2)
    evidence = page.evidence(6)
    truth = page.normals(page.strip_middles(6))
    R = page.tangents(np.linspace(-1, 1, 7))[1][1:-1]
    leans = np.radians([-8.0, 0.0, 8.0])
    across = np.cross(page.tangents(np.zeros(1))[1], truth)
    candidates = np.cos(leans)[:, None] * truth[:, None] + np.sin(leans)[:, None] * across[:, None]
    unary, pairwise = cost_tables(evidence, candidates, R, page.focal, Deviations(smoothness=1e3))
    assert np.all(np.argmin(unary, axis=1) == 1)
    assert pairwise[:, 1, 1].max() < 1e-6
    assert np.all(unary[:, [0, 2]] > 1.0)


@pytest.mark.parametrize("page", [BentPage(), BentPage(skew_rad=0.25), BentPage(tilt_rad=0.0)])
def test_ruling_directions_follow_vanishing_points(page: BentPage) -> None:
    found = ruling_directions(page.evidence(), page.focal, Deviations())
    truth = page.tangents(np.linspace(-1, 1, 13))[1]
    assert angles_between_deg(found, truth).max() < 0.5


def test_a_ruling_without_vanishing_point_takes_its_direction_from_the_others() -> None:
    page = BentPage()
    evidence = page.evidence()
    unknown = evidence.vanishing_deviations.copy()
    unknown[[0, 5, 6]] = np.inf
    wrong = evidence.vanishing_points.copy()
    wrong[[0, 5, 6]] = [1.0, 0.0, 0.0]
    evidence = replace(evidence, vanishing_deviations=unknown, vanishing_points=wrong)
    found = ruling_directions(evidence, page.focal, Deviations())
    assert angles_between_deg(found, page.tangents(np.linspace(-1, 1, 13))[1]).max() < 1.0


@pytest.mark.parametrize("page", [BentPage(), BentPage(radius=-1.0, skew_rad=-0.3, azimuth_rad=4.0)])
def test_normals_come_out_within_a_fine_step(page: BentPage) -> None:
    normals, _ = search_normals(page.evidence(), page.focal, COARSE_DEVIATIONS, InitialParameters())
    assert angles_between_deg(normals, page.normals(page.strip_middles(12))).max() < 1.0


@pytest.mark.parametrize("focal", [1.0, 1.3, 2.0])
def test_the_focal_length_is_found_without_error_in_the_data(focal: float) -> None:
    initial = estimate_initial_shape(BentPage(focal=focal).evidence(20), WIDE)
    assert initial.focal == pytest.approx(focal, rel=0.08)
    assert np.all(np.diff(initial.trial_focals) > 0)
    assert initial.objective.shape == initial.trial_focals.shape


def test_a_fixed_focal_length_is_taken_as_it_is() -> None:
    initial = estimate_initial_shape(
        BentPage().evidence(), FocalKnowledge(float(np.log(1.7)), 0.003, fixed=True)
    )
    assert initial.focal == pytest.approx(1.7)
    assert len(initial.trial_focals) == 1


def test_unit_vectors_of_nothing_are_finite() -> None:
    assert np.all(np.isfinite(unit(np.zeros((2, 3)))))
