"""The surfaces are isometries, and rays find them."""

import numpy as np
import pytest

from simulation.cone import Cone
from simulation.surfaces import Cylinder, Shape
from tests.simulation.scene import SHAPES

every_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())


def _sheet(count: int = 12) -> np.ndarray:
    axis = np.linspace(-0.95, 0.95, count)
    return np.stack(np.meshgrid(axis, 1.3 * axis), axis=-1).reshape(-1, 2)


@every_shape
def test_metric_tensor_is_the_identity(shape: Shape) -> None:
    sheet, h = _sheet(), 1e-5
    right, down_page = np.array([h, 0.0]), np.array([0.0, h])
    along_s = (shape.place(sheet + right) - shape.place(sheet - right)) / (2 * h)
    along_t = (shape.place(sheet + down_page) - shape.place(sheet - down_page)) / (2 * h)
    np.testing.assert_allclose(np.einsum("ij,ij->i", along_s, along_s), 1.0, atol=1e-7)
    np.testing.assert_allclose(np.einsum("ij,ij->i", along_t, along_t), 1.0, atol=1e-7)
    np.testing.assert_allclose(np.einsum("ij,ij->i", along_s, along_t), 0.0, atol=1e-7)
    across, down = shape.tangents(sheet)
    np.testing.assert_allclose(across, along_s, atol=1e-7)
    np.testing.assert_allclose(down, along_t, atol=1e-7)


@every_shape
def test_a_straight_line_keeps_its_length(shape: Shape) -> None:
    line = np.linspace([-0.8, -1.1], [0.7, 1.2], 20001)
    placed = shape.place(line)
    length = np.linalg.norm(np.diff(placed, axis=0), axis=1).sum()
    assert length == pytest.approx(np.linalg.norm(line[-1] - line[0]), rel=1e-7)


@every_shape
def test_rulings_are_straight_lines_of_the_surface(shape: Shape) -> None:
    sheet = _sheet(5)
    across, down = shape.tangents(sheet)
    ruling = shape.rulings(sheet)
    on_sheet = np.column_stack([np.sum(ruling * across, 1), np.sum(ruling * down, 1)])
    moved = shape.place(sheet + 0.3 * on_sheet)
    np.testing.assert_allclose(moved, shape.place(sheet) + 0.3 * ruling, atol=1e-9)


@every_shape
def test_rays_meet_the_surface_where_it_was_placed(shape: Shape) -> None:
    sheet = _sheet()
    origin = np.array([0.3, -0.4, -3.5])
    rays = (shape.place(sheet) - origin) * np.linspace(0.2, 40.0, len(sheet))[:, None]
    np.testing.assert_allclose(shape.meet(origin, rays), sheet, atol=1e-8)


@pytest.mark.parametrize("name", ["plane", "cylinder", "hump"])
def test_rays_that_turn_away_miss(name: str) -> None:
    shape = SHAPES[name]
    met = shape.meet(np.array([0.0, 0.0, -3.0]), np.array([[0.01, 0.02, -1.0]]))
    assert np.isnan(met).all()


def test_arc_length_of_a_parabola() -> None:
    # Z = X^2 / 2: s(X) = (X sqrt(1 + X^2) + asinh X) / 2, in closed form.
    x = np.linspace(-0.9, 0.9, 31)
    arc = (x * np.sqrt(1 + x**2) + np.arcsinh(x)) / 2
    placed = Cylinder((0.0, 0.0, 0.5)).place(np.column_stack([arc, np.zeros_like(arc)]))
    np.testing.assert_allclose(placed[:, 0], x, atol=1e-11)
    np.testing.assert_allclose(placed[:, 2], x**2 / 2, atol=1e-11)


def test_no_directrix_is_a_plane() -> None:
    sheet = _sheet(4)
    np.testing.assert_allclose(Cylinder(()).place(sheet)[:, :2], sheet, atol=1e-12)
    np.testing.assert_allclose(Cylinder(()).place(sheet)[:, 2], 0.0, atol=1e-12)


def test_cone_bulges_as_told() -> None:
    aside = np.array([[0.9, 0.0], [-0.9, 0.0]])
    apex = (0.0, -4.0)
    assert np.all(Cone(apex, 0.4, 1).place(aside)[:, 2] > 0.01)
    assert np.all(Cone(apex, 0.4, -1).place(aside)[:, 2] < -0.01)
    np.testing.assert_allclose(Cone(apex, 0.4, 1).place(np.zeros((1, 2))), 0.0, atol=1e-12)


@pytest.mark.parametrize("wrong", [((0.0, 0.0), 0.4, 1), ((1.0, 4.0), 0.0, 1), ((1.0, 4.0), 0.4, 0)])
def test_impossible_cones_are_refused(wrong: tuple[tuple[float, float], float, int]) -> None:
    with pytest.raises(ValueError, match="cone"):
        Cone(*wrong)
