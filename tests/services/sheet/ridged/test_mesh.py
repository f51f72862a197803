"""A mesh and the photo are inverses of one another, also beyond its border; a finer mesh has the same shape."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.arrays import Points
from services.sheet.ridged.mesh import REACH, SheetMesh, solve_2x2
from tests.services.sheet.ridged.sheets import CURVED, FLAT, FOLDED, HEIGHT, WIDTH, Sheet

SHEETS = {"flat": FLAT, "folded": FOLDED, "curved": CURVED}
MESHES = {name: sheet.mesh(13) for name, sheet in SHEETS.items()}


def grid_points(mesh: SheetMesh, count: int = 60, beyond: float = 0.0) -> Points:
    """Random grid coordinates (N, 2) of the mesh, and `beyond` its border."""
    size = np.array([mesh.columns - 1, mesh.rows - 1])
    return np.random.default_rng(1).uniform(-beyond, size + beyond, (count, 2))


@pytest.mark.parametrize("name", MESHES)
def test_photo_points_are_located_where_they_are_placed(name: str) -> None:
    mesh = MESHES[name]
    grid = grid_points(mesh)
    seen = mesh.project(mesh.place(grid).X)
    assert np.allclose(mesh.locate(seen), grid, atol=1e-6)
    # A start nearby saves the search for it.
    assert np.allclose(mesh.locate(seen, grid + 0.4), grid, atol=1e-6)


def test_points_that_are_not_seen_leave_the_others_where_they_are() -> None:
    mesh = MESHES["folded"]
    grid = grid_points(mesh)
    seen = mesh.project(mesh.place(grid).X)
    located = mesh.locate(np.concatenate([seen, [[9.0, 9.0], [-7.0, 0.0]]]))
    assert np.allclose(located[:-2], grid, atol=1e-6)
    assert np.isnan(located[-2:]).all()


@pytest.mark.parametrize("name", MESHES)
def test_page_and_photo_are_inverse_also_a_little_beyond_the_border(name: str) -> None:
    mesh = MESHES[name]
    page = mesh.page_of_grid(grid_points(mesh, beyond=0.9 * REACH))
    seen = mesh.to_photo(page)
    assert np.isfinite(seen).all()
    assert np.allclose(mesh.to_page(seen), page, atol=1e-6)
    assert np.allclose(mesh.page_of_grid(mesh.grid_of_page(page)), page)


@pytest.mark.parametrize("name", MESHES)
def test_jacobians_are_derivatives(name: str) -> None:
    mesh = MESHES[name]
    # Away from the nodes' rows and columns, where a bilinear mesh has kinks.
    grid = np.floor(grid_points(mesh)) + 0.37
    seen, step = mesh.project(mesh.place(grid).X), 1e-6
    slow = [(mesh.to_page(seen + d) - mesh.to_page(seen - d)) / (2 * step) for d in step * np.eye(2)]
    assert np.allclose(mesh.jacobians(seen), np.stack(slow, axis=2), rtol=1e-4, atol=1e-4)
    assert (np.linalg.det(mesh.jacobians(seen)) > 0).all()


def test_a_mesh_on_a_plane_is_the_plane() -> None:
    mesh = MESHES["flat"]
    page = np.random.default_rng(2).uniform(-0.5, 0.5, (50, 2)) * [WIDTH, HEIGHT]
    assert np.allclose(mesh.to_photo(page), FLAT.see(page), atol=1e-12)
    assert mesh.size == pytest.approx((WIDTH, HEIGHT))
    assert mesh.aspect_ratio == pytest.approx(WIDTH / HEIGHT)


def test_what_is_far_off_or_out_of_reach_is_not_seen() -> None:
    mesh = MESHES["folded"]
    assert np.isnan(mesh.locate(np.array([[5.0, 5.0], [np.nan, 0.0]]))).all()
    assert np.isnan(mesh.jacobians(np.array([[5.0, 5.0]]))).all()
    beyond = mesh.page_of_grid(np.array([[-2.0 * REACH, 3.0], [3.0, mesh.rows - 1 + 2 * REACH]]))
    assert np.isnan(mesh.to_photo(beyond)).all()
    assert np.isnan(mesh.to_photo(np.full((1, 2), np.nan))).all()


def test_what_faces_away_or_lies_behind_the_camera_is_not_seen() -> None:
    flat = MESHES["flat"]
    middle = np.zeros((1, 2))
    turned = replace(flat, nodes=flat.nodes[:, ::-1])
    assert np.isnan(turned.to_photo(middle)).all()
    behind = replace(flat, nodes=flat.nodes - [0.0, 0.0, 10.0])
    assert np.isnan(behind.to_photo(middle)).all()
    assert np.isfinite(flat.to_photo(middle)).all()


@pytest.mark.parametrize("columns", [7, 13, 25, 49])
@pytest.mark.parametrize("name", MESHES)
def test_a_resampled_mesh_keeps_the_shape(name: str, columns: int) -> None:
    mesh = MESHES[name]
    other = mesh.resampled(columns)
    assert other.columns == columns
    assert other.size == pytest.approx(mesh.size)
    assert other.aspect == pytest.approx(mesh.aspect, rel=0.1)
    page = np.random.default_rng(3).uniform(-0.49, 0.49, (80, 2)) * [WIDTH, HEIGHT]
    # A coarser mesh cuts the corners of a bend; a plane has none.
    bound = {"flat": 1e-9, "folded": 0.05, "curved": 0.012}[name] * (1 if columns < 13 else 0.4)
    assert np.abs(other.to_photo(page) - mesh.to_photo(page)).max() < bound
    corners = mesh.page_of_grid(np.array([[0.0, 0.0], [12.0, 0.0], [12.0, mesh.rows - 1.0]]))
    assert np.allclose(other.to_photo(corners), mesh.to_photo(corners))


def test_a_mesh_of_as_many_columns_is_the_mesh() -> None:
    assert MESHES["curved"].resampled(13) is MESHES["curved"]


def test_a_finer_mesh_is_nearer_to_a_bent_sheet() -> None:
    page = np.random.default_rng(4).uniform(-0.49, 0.49, (200, 2)) * [WIDTH, HEIGHT]
    misses = [
        float(np.abs(CURVED.mesh(columns).to_photo(page) - CURVED.see(page)).max()) for columns in (7, 13, 25)
    ]
    # Chords of a circle: a quarter of the sagitta at half their length.
    assert 3 < misses[0] / misses[1] < 5
    assert 3 < misses[1] / misses[2] < 5


@given(
    st.tuples(*[st.floats(-25, 25)] * 3),
    st.floats(0.6, 5.0),
)
def test_every_bent_sheet_before_the_camera_can_be_followed(
    angles: tuple[float, float, float], radius: float
) -> None:
    mesh = Sheet(radius=radius, angles_deg=angles).mesh(9)
    grid = grid_points(mesh, 20)
    placed = mesh.place(grid)
    facing = np.einsum("ni,ni->n", np.cross(placed.X_c, placed.X_r), placed.X) > 0.01
    found = mesh.locate(mesh.project(placed.X), grid)
    assert np.allclose(found[facing], grid[facing], atol=1e-6)


def test_small_systems_are_solved_and_singular_ones_are_no_error() -> None:
    rng = np.random.default_rng(0)
    A, b = rng.normal(0, 1, (20, 2, 2)), rng.normal(0, 1, (20, 2))
    assert np.allclose(solve_2x2(A, b), np.linalg.solve(A, b[:, :, None])[:, :, 0])
    assert np.isfinite(solve_2x2(np.ones((1, 2, 2)), np.ones((1, 2)))).all()
