"""Relaxed sheets: hardly stretched, seen as they are placed, alike with every run."""

from dataclasses import replace

import numpy as np
import pytest

from simulation.camera import Camera, Pose
from simulation.creased import Crossed, Crumpled
from simulation.flat_page import Page
from simulation.relaxed import CRUMPLED_PAPER, FOLDED_PAPER, Relaxation, Relaxed
from simulation.truth import Truth

HALF_HEIGHT = 1.4
SHAPES = {
    "crossed": Relaxed(Crossed(HALF_HEIGHT, 20.0, 18.0), replace(FOLDED_PAPER, cell=0.1)),
    "opened between": Relaxed(
        Crossed(HALF_HEIGHT, -20.0, -12.0, True, (0.03, -0.02), 1.0), replace(FOLDED_PAPER, cell=0.1)
    ),
    "crumpled": Relaxed(Crumpled(HALF_HEIGHT, 7, 14.0), replace(CRUMPLED_PAPER, cell=0.1)),
}
"""Of coarse cells, which take a tenth of the time."""
FINE = {
    "crossed, fine": Relaxed(Crossed(HALF_HEIGHT, 20.0, 18.0), FOLDED_PAPER),
    "crumpled, fine": Relaxed(Crumpled(HALF_HEIGHT, 7, 14.0), CRUMPLED_PAPER),
}
every_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())


def _grid(count: int = 60) -> np.ndarray:
    s, t = np.linspace(-1, 1, count), HALF_HEIGHT * np.linspace(-1, 1, count)
    return np.stack(np.meshgrid(s, t), axis=-1).reshape(-1, 2)


def _lengths(shape: Relaxed, sheet: np.ndarray, step: np.ndarray) -> np.ndarray:
    return np.linalg.norm(shape.place(sheet + step) - shape.place(sheet - step), axis=1) / 2


@pytest.mark.parametrize("shape", (SHAPES | FINE).values(), ids=(SHAPES | FINE).keys())
def test_paper_is_hardly_stretched(shape: Relaxed) -> None:
    sheet = _grid()
    # By differences, along both axes and both diagonals.
    for way in ((1, 0), (0, 1), (0.6, 0.8), (0.8, -0.6)):
        strain = _lengths(shape, sheet, 1e-5 * np.array(way)) / 1e-5 - 1.0
        assert np.sqrt(np.mean(strain**2)) < 0.002
        assert np.abs(strain).max() < 0.025
    strains = shape.stretch(sheet)
    assert np.all(strains[:, 0] <= strains[:, 1] + 1e-12)
    along = _lengths(shape, sheet, np.array([1e-5, 0.0])) / 1e-5 - 1.0
    assert np.all((along > strains[:, 0] - 1e-6) & (along < strains[:, 1] + 1e-6))


@every_shape
def test_a_camera_sees_each_point_once(shape: Relaxed) -> None:
    page = Page(np.full((280, 200), 255, np.uint8))
    truth = Truth(page, shape, 0.0, Pose(0.4, 0.9, 0.1, (0.0, 0.0, 4.0)), Camera(600.0, 420, 540))
    truth.check_visible()
    sheet = _grid()
    np.testing.assert_allclose(truth.photo_to_sheet(truth.sheet_to_photo(sheet)), sheet, atol=1e-8)
    away = shape.meet(np.array([0.0, 0.0, -4.0]), np.array([[0.0, 0.0, -1.0], [3.0, 0.0, 1.0]]))
    assert np.isnan(away).all()


@every_shape
def test_tangents_are_orthonormal_and_follow_the_surface(shape: Relaxed) -> None:
    sheet = _grid(20)
    across, down = shape.tangents(sheet)
    for a, b, expected in ((across, across, 1.0), (down, down, 1.0), (across, down, 0.0)):
        np.testing.assert_allclose(np.einsum("ij,ij->i", a, b), expected, atol=1e-12)
    step = np.array([1e-5, 0.0])
    measured = (shape.place(sheet + step) - shape.place(sheet - step)) / 2e-5
    assert np.degrees(np.abs(np.cross(measured, across)).max()) < 1.5
    assert np.isnan(shape.rulings(sheet)).all()


def test_creases_turn_where_they_were_folded_and_panels_are_flat() -> None:
    shape = FINE["crossed, fine"]

    def heading(sheet: list[list[float]], axis: int) -> np.ndarray:
        return np.degrees(np.arcsin(-shape.tangents(np.array(sheet))[axis][:, 2]))

    # Across the second crease, well above and well below the first: a valley and a ridge.
    for t, way in ((-1.0, 1.0), (1.0, -1.0)):
        left, right = heading([[-0.2, t], [0.2, t]], 0)
        assert 7.0 < way * (right - left) < 20.0
        flat = heading([[0.2, t], [0.6, t]], 0)
        assert abs(flat[1] - flat[0]) < 4.0
    above, below = heading([[-0.6, -0.2], [-0.6, 0.2]], 1)
    assert 10.0 < below - above < 28.0


def test_facets_are_about_as_steep_as_wanted_and_drawn_from_the_seed() -> None:
    def steepness(angle: float) -> float:
        shape = Relaxed(Crumpled(HALF_HEIGHT, 7, angle), Relaxation(cell=0.1))
        across, down = shape.tangents(_grid(40))
        normals = np.cross(across, down)
        return float(np.degrees(np.percentile(np.arccos(np.clip(normals[:, 2], -1, 1)), 95)))

    gentle, steep = steepness(8.0), steepness(14.0)
    assert gentle < steep
    assert 5.0 < steep < 14.0
    grid = _grid(9)
    first, again, other = (Crumpled(HALF_HEIGHT, seed).wanted(grid) for seed in (7, 7, 8))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.02


def test_the_sheet_goes_straight_on_beside_what_was_relaxed() -> None:
    shape = SHAPES["crumpled"]
    beyond = shape.place(np.array([[2.0, 0.3], [2.5, 0.3], [3.0, 0.3]]))
    np.testing.assert_allclose(beyond[2] - beyond[1], beyond[1] - beyond[0], atol=1e-9)
