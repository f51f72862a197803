"""The constraints hold on a page bent to a cylinder, and nowhere near it; their derivatives are right."""

import numpy as np
import pytest

from benchmarks.dissertation_chain.strips import constraints
from benchmarks.dissertation_chain.strips.constraints import lines_of_sight, strip_vectors, tangents
from benchmarks.dissertation_chain.strips.initial import FocalKnowledge
from benchmarks.dissertation_chain.strips.optimization import StripObjective
from tests.benchmarks.dissertation_chain.strips.bent_page import BentPage, disturbed

PAGES = [BentPage(), BentPage(skew_rad=0.4, roll_rad=-0.5), BentPage(radius=-0.9, azimuth_rad=3.5)]
COUNT = 12


def terms(
    page: BentPage, normals: np.ndarray | None = None, focal: float | None = None
) -> dict[str, np.ndarray]:
    evidence = page.evidence(COUNT)
    normals = page.normals(page.strip_middles(COUNT)) if normals is None else normals
    vectors = strip_vectors(evidence, normals, focal or page.focal)
    weights = evidence.major_weights
    found = {
        "mu_1": constraints.developability(vectors, 1.0),
        "mu_2": constraints.parallelism(vectors, weights, 1.0),
        "mu_3": constraints.geodesic(vectors, np.ones(COUNT - 1), 1.0),
        "mu_4": constraints.orthogonality(vectors, weights, 1.0),
        "mu_5": constraints.smoothness(vectors, 1.0),
        "mu_6": constraints.unit_length(vectors, 1.0),
        "vanishing": constraints.vanishing(vectors, evidence, 1.0),
    }
    return {name: term.residuals for name, term in found.items()}


@pytest.mark.parametrize("page", PAGES)
def test_constraints_hold_at_the_truth(page: BentPage) -> None:
    found = terms(page)
    turn = found.pop("mu_5").reshape(-1, 3)
    for name, residuals in found.items():
        assert np.abs(residuals).max() < 1e-12, name
    # Smoothness alone is a wish: strips of a cylinder turn by the same small angle.
    expected = 2 * np.sin(1 / COUNT / abs(page.radius))
    np.testing.assert_allclose(np.linalg.norm(turn, axis=1), expected, rtol=1e-9)


@pytest.mark.parametrize("name", ["mu_1", "mu_2", "mu_3", "mu_4", "vanishing"])
def test_constraints_break_when_one_strip_leans(name: str) -> None:
    page = BentPage(skew_rad=0.2)
    normals = page.normals(page.strip_middles(COUNT))
    down = page.tangents(np.zeros(1))[1][0]
    normals[5] = constraints.unit(normals[5] + 0.2 * down)
    assert np.abs(terms(page, normals)[name]).max() > 0.005


def test_a_wrong_focal_length_shows_in_flows_and_vanishing_points() -> None:
    found = terms(BentPage(), focal=2.0)
    assert np.abs(found["mu_4"]).max() > 0.02
    assert np.abs(found["vanishing"]).max() > 0.02


def test_unit_length_is_told_with_its_sign() -> None:
    page = BentPage()
    found = terms(page, 1.1 * page.normals(page.strip_middles(COUNT)))
    np.testing.assert_allclose(found["mu_6"], 0.1)


def test_tangents_lie_in_the_plane_and_project_to_their_direction() -> None:
    rng = np.random.default_rng(3)
    points, normals = rng.normal(0, 0.4, (50, 2)), constraints.unit(rng.normal([0, 0, 1], 0.3, (50, 3)))
    angles = rng.uniform(-np.pi, np.pi, 50)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    focal = 1.4
    T = tangents(directions, points, normals, focal)
    np.testing.assert_allclose(np.linalg.norm(T, axis=1), 1.0)
    assert np.abs(np.einsum("na,na->n", T, normals)).max() < 1e-12
    facing = np.einsum("na,na->n", normals, lines_of_sight(points, focal)) > 0
    # A step along T moves the image along the direction, forwards where the plane faces the camera.
    seen = T[:, :2] - points * T[:, 2:] / focal
    along = np.einsum("na,na->n", seen, directions) / np.linalg.norm(seen, axis=1)
    np.testing.assert_allclose(along[facing], 1.0)
    assert facing.sum() > 40


@pytest.mark.parametrize("fixed", [False, True])
def test_the_jacobian_is_that_of_the_residuals(fixed: bool) -> None:
    rng = np.random.default_rng(1)
    page = BentPage(skew_rad=0.3)
    evidence = disturbed(page.evidence(5, 4), rng, 0.05)
    knowledge = FocalKnowledge(0.2, 0.3, fixed)
    objective = StripObjective(evidence, 1.2, knowledge, constraints.Deviations(), 0.01)
    normals = page.normals(page.strip_middles(5)) + rng.normal(0, 0.05, (5, 3))
    x = objective.pack(normals, 1.2)
    jacobian = objective.jacobian(x).toarray()
    step = 1e-6
    numeric = np.stack(
        [
            (objective.residuals(x + d) - objective.residuals(x - d)) / (2 * step)
            for d in step * np.eye(len(x))
        ],
        axis=1,
    )
    assert jacobian.shape == numeric.shape == (len(objective.residuals(x)), 15 + (not fixed))
    np.testing.assert_allclose(jacobian, numeric, atol=1e-5 * np.abs(numeric).max())


def test_the_jacobian_is_banded() -> None:
    page = BentPage()
    evidence = page.evidence(20, 4)
    objective = StripObjective(evidence, 1.3, FocalKnowledge(0.2, 0.3), constraints.Deviations(), 0.01)
    jacobian = objective.jacobian(objective.pack(page.normals(page.strip_middles(20)), 1.3))
    jacobian.eliminate_zeros()
    strips = [
        set(row.indices[row.indices < 60] // 3) for row in (jacobian[[k]] for k in range(jacobian.shape[0]))
    ]
    assert max(max(s) - min(s) for s in strips if s) == 1
