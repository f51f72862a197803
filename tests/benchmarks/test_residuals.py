"""Errors against analytic cases: what a similarity takes away, and what it must leave."""

import numpy as np
import pytest

from benchmarks.residuals import (
    direction_error_deg,
    field_of_view_error_deg,
    fit_similarity,
    is_upright,
    mesh_residual_percent,
    normal_error_deg,
    similarity_residual,
)
from simulation.camera import Camera, Pose
from simulation.flat_page import Page
from simulation.surfaces import Plane
from simulation.truth import Truth

PAGE = Page(np.full((500, 320), 255, np.uint8))
TRUTH = Truth(PAGE, Plane(), 0.1, Pose(0.4, 1.0, 0.2, (0.05, 0.0, 3.6)), Camera(500.0, 420, 540))


def _square() -> np.ndarray:
    return np.stack(np.meshgrid(np.arange(10.0), np.arange(10.0)), axis=-1).reshape(-1, 2)


def _mesh(width: int, height: int, nodes: int, H_page_output: np.ndarray) -> np.ndarray:
    """Mesh of an output that shows the page by `H_page_output`, through the true forward map."""
    x, y = np.meshgrid(np.linspace(0, width - 1, nodes), np.linspace(0, height - 1, nodes))
    output = np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)])
    page = output @ H_page_output.T
    return TRUTH.page_to_photo(page[:, :2] / page[:, 2:]).reshape(nodes, nodes, 2)


def test_similarity_is_found_and_taken_away() -> None:
    source = _square()
    turn = 0.7 * np.exp(0.9j)
    moved = source @ np.array([1, 1j]) * turn + (3 - 4j)
    target = np.column_stack([moved.real, moved.imag])
    a, b = fit_similarity(source, target)
    assert abs(a - turn) < 1e-12
    assert abs(b - (3 - 4j)) < 1e-11
    assert similarity_residual(source, target) < 1e-12


def test_stretch_leaves_its_rest() -> None:
    # x stretched by 1 + e, y by 1 - e: the mean scale is 1, the rest e times the RMS radius.
    source = _square() - 4.5
    target = source * np.array([1.02, 0.98])
    radius = np.sqrt((source**2).sum(axis=1).mean())
    assert similarity_residual(source, target) == pytest.approx(0.02 * radius, rel=1e-9)


def test_mirroring_is_no_similarity() -> None:
    source = _square() - 4.5
    assert similarity_residual(source, source * np.array([-1, 1])) > 4


def test_the_true_mesh_leaves_nothing_and_is_upright() -> None:
    half = np.diag([2.0, 2.0, 1.0])
    mesh = _mesh(160, 250, 9, half)
    assert mesh_residual_percent(mesh, 160, 250, TRUTH) < 1e-9
    assert is_upright(mesh, 160, 250, TRUTH)


def test_a_wrong_aspect_is_seen_in_percent_of_the_width() -> None:
    wrong = np.diag([2.0, 2.0 * 1.01, 1.0])
    mesh = _mesh(140, 220, 9, wrong)
    residual = mesh_residual_percent(mesh, 140, 220, TRUTH)
    # About half of the 1 % goes into the scale; the rest acts on the RMS half sizes of 80 and 125 px.
    assert 0.1 < residual < 1.0


def test_few_nodes_are_interpolated() -> None:
    mesh = _mesh(160, 250, 2, np.diag([2.0, 2.0, 1.0]))
    residual = mesh_residual_percent(mesh, 160, 250, TRUTH)
    # Four nodes hold no perspective: the bilinear mesh is that far from the truth.
    assert 0.1 < residual < 10


def test_turned_and_mirrored_outputs_are_not_upright() -> None:
    upside_down = np.array([[-2.0, 0, 319], [0, -2.0, 499], [0, 0, 1]])
    mirrored = np.array([[-2.0, 0, 319], [0, 2.0, 0], [0, 0, 1]])
    for wrong in (upside_down, mirrored):
        assert not is_upright(_mesh(160, 250, 9, wrong), 160, 250, TRUTH)
    assert mesh_residual_percent(_mesh(160, 250, 9, upside_down), 160, 250, TRUTH) < 1e-9


def test_a_mesh_beside_the_page_has_no_residual() -> None:
    assert np.isnan(mesh_residual_percent(np.full((3, 3, 2), -50.0), 100, 100, TRUTH))
    assert not is_upright(np.full((3, 3, 2), -50.0), 100, 100, TRUTH)


def test_field_of_view_error_is_of_the_half_angle() -> None:
    truth = Truth(PAGE, Plane(), 0.0, Pose(), Camera(500.0, 601, 801))
    assert field_of_view_error_deg(500.0, truth) == 0
    assert field_of_view_error_deg(500.0 * np.sqrt(3.0), truth) == pytest.approx(15.0)


def test_normal_error_ignores_sign_and_length() -> None:
    truth = Truth(PAGE, Plane(), 0.0, Pose(np.radians(30.0), 0.0, 0.0), Camera(500.0, 420, 540))
    assert normal_error_deg((0.0, 0.0, -2.0), truth) == pytest.approx(30.0)
    assert normal_error_deg((-0.5, 0.0, np.sqrt(0.75)), truth) == pytest.approx(0.0, abs=1e-5)


def test_direction_error_is_modulo_pi() -> None:
    measured = np.radians([89.0, -89.0, 10.0])
    expected = np.radians([-90.0, 91.0, 7.0])
    assert direction_error_deg(measured, expected) == pytest.approx((1 + 0 + 3) / 3)
