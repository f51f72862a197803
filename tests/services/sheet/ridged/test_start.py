"""The first mesh: the rectangle that four corners show, its border along the sides."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from services.arrays import Floats, Points
from services.sheet.ridged.mesh import LEAST_ROWS, SheetMesh
from services.sheet.ridged.start import MOST_ROWS, mesh_between_sides
from tests.services.sheet.ridged.sheets import CURVED, FLAT, FOCAL, HEIGHT, WIDTH, observe

NO_SIDES = (np.zeros((0, 2)),) * 4


def seen_rectangle(
    width: float, height: float, angles_deg: tuple[float, float, float], focal: float
) -> Points:
    """Corners (4, 2) of a rectangle before an analytic camera."""
    flat = 0.5 * np.array([[-width, -height], [width, -height], [width, height], [-width, height]])
    rotation = Rotation.from_euler("xyz", angles_deg, degrees=True).as_matrix()
    X = np.column_stack([flat, np.zeros(4)]) @ rotation.T + np.array([0.03, -0.02, focal])
    return np.asarray(focal * X[:, :2] / X[:, 2:])


def border(mesh: SheetMesh, side: int) -> Points:
    """Photo points (N, 2) of the mesh's top, right, bottom or left."""
    nodes = (mesh.nodes[0], mesh.nodes[:, -1], mesh.nodes[-1], mesh.nodes[:, 0])[side]
    return mesh.project(nodes)


def distance(points: Points, line: Points) -> Floats:
    """Distances (N,) of points from the nearest part of a polygonal line."""
    a, d = line[:-1], np.diff(line, axis=0)
    t = np.einsum("nki,ki->nk", points[:, None] - a, d) / (d**2).sum(axis=1)
    near = a + np.clip(t, 0, 1)[..., None] * d
    return np.asarray(np.linalg.norm(points[:, None] - near, axis=2).min(axis=1))


@given(
    angles=st.tuples(st.floats(-35, 35), st.floats(-35, 35), st.floats(-20, 20)),
    height=st.floats(0.5, 2.5),
    focal=st.floats(1.2, 4.0),
)
def test_exact_corners_and_focal_length_give_aspect_and_shape(
    angles: tuple[float, float, float], height: float, focal: float
) -> None:
    assume(focal > 0.9 * np.hypot(1.0, height))
    mesh = mesh_between_sides(seen_rectangle(1.0, height, angles, focal), NO_SIDES, focal, 8)
    assert mesh is not None
    assert 1 / mesh.aspect_ratio == pytest.approx(height, rel=1e-4)
    edges = np.linalg.norm(np.diff(mesh.nodes, axis=1), axis=2) / mesh.step
    assert edges == pytest.approx(np.ones(edges.shape), rel=1e-4)
    down = np.linalg.norm(np.diff(mesh.nodes, axis=0), axis=2) / (mesh.step * mesh.aspect)
    assert down == pytest.approx(np.ones(down.shape), rel=1e-4)
    assert (mesh.nodes[..., 2] > 0).all()


def test_corners_of_a_sheet_are_those_of_its_mesh() -> None:
    corners = FLAT.corners()
    mesh = mesh_between_sides(corners, NO_SIDES, FOCAL, 12)
    assert mesh is not None
    ends = mesh.nodes[[0, 0, -1, -1], [0, -1, -1, 0]]
    assert mesh.project(ends) == pytest.approx(corners, abs=1e-6)
    width, height = mesh.size
    # A page unit is a photo unit at the middle of the sheet.
    middle = np.array([[width / 2, height / 2]])
    assert np.linalg.det(mesh.jacobians(mesh.to_photo(middle)))[0] == pytest.approx(1.0, rel=0.35)
    assert width / height == pytest.approx(WIDTH / HEIGHT, rel=1e-4)


def test_the_border_follows_bent_sides() -> None:
    sides = tuple(side.points for side in observe(CURVED, np.random.default_rng(0), 0.0).sides if side)
    straight = mesh_between_sides(CURVED.corners(), NO_SIDES, FOCAL, 24)
    bent = mesh_between_sides(CURVED.corners(), sides, FOCAL, 24)
    assert straight is not None
    assert bent is not None
    for k in range(4):
        before, after = (distance(sides[k], border(m, k)) for m in (straight, bent))
        # The upright sides of this cylinder are straight.
        assert before.max() > 0.01 if k % 2 == 0 else before.max() < 1e-3
        assert after.max() < 0.003
    # And what lies between them follows, half way in the middle of top and bottom, which bend alike.
    assert np.abs(bent.nodes[17, 12] - straight.nodes[17, 12]).max() > 0.01


def test_a_side_with_few_points_is_straight() -> None:
    sides = tuple(side.points for side in observe(CURVED, np.random.default_rng(0), 0.0).sides if side)
    known = mesh_between_sides(CURVED.corners(), (sides[0][:3], *sides[1:]), FOCAL, 12)
    assert known is not None
    top = border(known, 0)
    way = top[-1] - top[0]
    off = (top - top[0]) @ np.array([-way[1], way[0]]) / np.linalg.norm(way)
    assert np.abs(off).max() < 1e-6


@pytest.mark.parametrize(
    "corners",
    [
        np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]),  # two in one place
        np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]]),  # mirrored
        np.array([[-0.5, -0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, 0.5]]),  # crossed
        np.array([[-0.5, -0.5], [0.5, -0.5], [-0.1, -0.2], [-0.5, 0.5]]),  # not convex
        np.array([[-0.9, -0.01], [0.9, -0.01], [0.9, 0.01], [-0.9, 0.01]]),  # a thread
    ],
)
def test_what_no_rectangle_looks_like_gives_no_mesh(corners: Points) -> None:
    assert mesh_between_sides(corners, NO_SIDES, 1.3, 8) is None


@pytest.mark.parametrize(("height", "rows"), [(0.1, LEAST_ROWS), (15.0, MOST_ROWS)])
def test_the_number_of_rows_is_bounded(height: float, rows: int) -> None:
    mesh = mesh_between_sides(seen_rectangle(1.0, height, (0, 0, 0), 20.0), NO_SIDES, 20.0, 24)
    assert mesh is not None
    assert mesh.rows == rows
    assert 1 / mesh.aspect_ratio == pytest.approx(height, rel=1e-3)
