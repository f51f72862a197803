"""Kernels of bent and creased sheets beside their plain versions: also beyond the horizon, where rulings cross."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.arrays import Floats, Points
from services.kernels.library import find_kernels
from services.sheet.developable.surface import (
    DevelopableSurface,
    Unrolled,
    bend_basis,
    roll_frames,
    roll_frames_plain,
)
from services.sheet.developable.variation import vary_page, vary_page_plain
from services.sheet.ridged.blocks import SparseRows, stacked
from services.sheet.ridged.mesh import SheetMesh
from services.sheet.ridged.normal_equations import normal_equations, normal_equations_plain
from services.sheet.ridged.point_jacobians import point_jacobians, point_jacobians_plain
from tests.services.sheet.developable.sheets import Bent
from tests.services.sheet.ridged.sheets import CURVED, FOLDED

pytestmark = pytest.mark.skipif(find_kernels() is None, reason="needs kernels, which a C compiler makes")
FIELDS = ("sheet", "page", "jacobians", "X", "A", "R")


@st.composite
def surfaces(draw: st.DrawFn) -> DevelopableSurface:
    """Some are bent so much that they turn away and that rulings cross on them."""
    wild = draw(st.sampled_from([1.0, 6.0]))
    count = draw(st.integers(4, 21))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    bent = Bent(
        tuple(rng.uniform(-0.5, 0.5, 3)),
        rng.uniform(0.8, 3.0),
        tuple(rng.uniform(-0.2, 0.2, 2)),
        rng.uniform(-1.7, 1.7),
        tuple(wild * rng.uniform(-0.5, 0.5, 2)),
        tuple(wild * rng.uniform(-1.0, 1.0, count)),
    )
    return bent.surface(bend_basis(-1.0, 1.0, count, 0.3, tabulated=draw(st.sampled_from([7, 160, 300]))))


def points(count: int, size: float = 3.0) -> Points:
    """Mostly beyond the photo."""
    return np.random.default_rng(count).uniform(-size, size, (count, 2))


def assert_close(ours: Floats, plain: Floats, tolerance: float) -> None:
    """Of the greatest number of each column; the same ones are infinite or none."""
    assert ours.shape == plain.shape
    known = np.isfinite(plain)
    assert np.array_equal(known, np.isfinite(ours))
    columns = np.where(known, plain, 0.0).reshape(-1, plain.shape[-1])
    greatest = np.abs(columns).max(axis=0, initial=1e-12)
    assert (np.abs(np.where(known, ours - plain, 0.0)) <= tolerance * greatest).all()


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@given(surfaces(), st.sampled_from([0, 1, 63, 64, 65, 200]))
@settings(max_examples=60)
def test_photo_points_on_the_page(surface: DevelopableSurface, count: int) -> None:
    photo = points(count)
    ours, plain = surface.unroll(photo), surface.unroll_plain(photo)
    for field in FIELDS:
        assert_close(getattr(ours, field), getattr(plain, field), 1e-9)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@given(surfaces(), st.sampled_from([0, 1, 64, 200]))
@settings(max_examples=60)
def test_page_points_in_the_photo(surface: DevelopableSurface, count: int) -> None:
    page = points(count)
    ours, plain = surface.to_photo(page), surface.to_photo_plain(page)
    assert np.array_equal(np.isnan(ours), np.isnan(plain))
    assert np.allclose(ours, plain, rtol=1e-9, atol=1e-9, equal_nan=True)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@given(surfaces(), st.sampled_from([1, 65]), st.integers(0, 2), st.integers(0, 2))
@settings(max_examples=60)
def test_how_the_page_moves(surface: DevelopableSurface, count: int, still: int, room: int) -> None:
    at, turn = surface.unroll_plain(points(count)), points(3)[:, :1] * np.eye(3) + 0.1
    ours, plain = vary_page(surface, at, turn, still, room), vary_page_plain(surface, at, turn, still, room)
    used = slice(ours.shape[2] - room)
    assert_close(ours[:, :, used], plain[:, :, used], 1e-11)
    assert ours.shape == plain.shape


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_points_that_are_no_numbers_stay_so() -> None:
    surface, photo = Bent().surface(), points(70, 0.4)
    photo[[3, 66], 0] = np.nan
    ours = surface.unroll(photo)
    for field in FIELDS:
        assert np.array_equal(
            np.isnan(getattr(ours, field)), np.isnan(getattr(surface.unroll_plain(photo), field))
        )
    assert np.array_equal(np.isnan(surface.to_photo(photo)), np.isnan(surface.to_photo_plain(photo)))


def test_points_need_not_be_together_in_memory() -> None:
    surface, photo = Bent().surface(), np.asfortranarray(points(70, 0.4))
    ours, packed = surface.unroll(photo[::2]), surface.unroll(photo[::2].copy())
    assert np.array_equal(ours.page, packed.page)
    copied = Unrolled(photo[::2], *(np.asfortranarray(getattr(ours, field)) for field in FIELDS))
    assert np.array_equal(vary_page(surface, copied), vary_page(surface, ours))
    assert np.array_equal(surface.to_photo(photo[::2]), surface.to_photo(photo[::2].copy()))


@pytest.mark.parametrize("count", [1, 159])
def test_frames_that_roll(count: int) -> None:
    turns = np.random.default_rng(count).normal(0, 0.1, (count, 3))
    turns[0] = 0.0
    ours = roll_frames(turns)
    assert np.allclose(ours, roll_frames_plain(turns), rtol=0, atol=1e-13)
    assert ours.shape == (count + 1, 3, 3)


@given(
    st.integers(1, 12), st.integers(0, 4), st.integers(0, 40), st.integers(1, 9), st.integers(0, 2**32 - 1)
)
def test_normal_equations(own: int, border: int, count: int, width: int, seed: int) -> None:
    """Also where entries are zero, or of one column."""
    rng = np.random.default_rng(seed)
    unknowns = own + border
    rows = [
        SparseRows(rng.integers(0, unknowns, (m, k)), rng.integers(-2, 3, (m, k)) / 1.0)
        for m, k in ((count, width), (3, 1))
    ]
    residuals, order = rng.normal(0, 1, count + 3), rng.permutation(unknowns)
    ours = normal_equations(rows, residuals, order, border)
    plain = normal_equations_plain(stacked(rows, unknowns), residuals, order, border)
    for field in ("border", "corner", "gradient"):
        assert np.allclose(getattr(ours, field), getattr(plain, field), rtol=0, atol=1e-12)
    # Entries that cancel each other widen no band of ours.
    common = min(len(ours.band), len(plain.band))
    assert np.allclose(ours.band[:common], plain.band[:common], rtol=0, atol=1e-12)
    assert not ours.band[common:].any()
    assert not plain.band[common:].any()


def test_rows_of_other_unknowns_are_refused() -> None:
    for columns, residuals in ((-1, 1), (3, 1), (0, 2)):
        with pytest.raises(IndexError):
            normal_equations(
                [SparseRows(np.array([[columns]]), np.ones((1, 1)))], np.ones(residuals), np.arange(3), 1
            )


def crumpled_mesh(seed: int) -> SheetMesh:
    """A sheet of some cells with nodes anywhere near their places, one of them behind the camera."""
    rng = np.random.default_rng(seed)
    mesh = (CURVED, FOLDED)[seed % 2].mesh(int(rng.integers(5, 14)))
    nodes = mesh.nodes + rng.normal(0, 0.3 * mesh.step * rng.integers(0, 2), mesh.nodes.shape)
    nodes[-1, -1, 2] = -0.1
    return SheetMesh(nodes, mesh.focal, mesh.step, mesh.aspect, mesh.origin)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@given(st.sampled_from([0, 1, 63, 65, 200]), st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_photo_points_on_a_mesh(count: int, seed: int) -> None:
    """Also those that it does not show, and those that are no numbers."""
    mesh, rng = crumpled_mesh(seed), np.random.default_rng(seed)
    start = rng.uniform(-1, 1, (count, 2)) + rng.uniform(0, 1, (count, 2)) * [mesh.columns - 1, mesh.rows - 1]
    photo = mesh.project(mesh.place(start + rng.normal(0, 1, (count, 2))).X)
    photo[::7] += 5.0
    ours, plain = mesh.locate(photo, start), mesh.locate_plain(photo, start)
    assert np.array_equal(np.isnan(ours), np.isnan(plain))
    assert np.allclose(ours, plain, rtol=0, atol=1e-6, equal_nan=True)


@given(st.sampled_from([0, 1, 65]), st.integers(0, 2**32 - 1))
def test_how_points_on_a_mesh_move(count: int, seed: int) -> None:
    mesh, rng = crumpled_mesh(seed), np.random.default_rng(seed)
    grid = rng.uniform(-1, 1, (count, 2)) + rng.uniform(0, 1, (count, 2)) * [mesh.columns - 1, mesh.rows - 1]
    photo, known = rng.uniform(-1, 1, (count, 2)), rng.random(count) < 0.8
    of_mesh = mesh, photo, grid, known, 3 * mesh.rows * mesh.columns + 2
    for ours, plain in zip(point_jacobians(*of_mesh), point_jacobians_plain(*of_mesh), strict=True):
        assert np.array_equal(ours.columns, plain.columns)
        assert np.allclose(ours.entries, plain.entries, rtol=1e-9, atol=1e-9)
