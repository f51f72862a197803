"""The sheet is isometric, its maps are one another's inverses, and cylinders, cones and planes have closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.arrays import Floats, Points
from services.geometry.camera import plane_to_image, rotation_from_vector
from services.geometry.homographies import transform_points
from services.geometry.page_map import PlaneMap
from services.sheet.developable.surface import (
    BendBasis,
    DevelopableSurface,
    bend_basis,
    rotations,
    running_products,
)
from simulation.cone import Cone
from simulation.flat_page import Page
from simulation.scenes import BOOK, CONE, CURVATURE_SERIES, POSES, WAVE
from simulation.surfaces import Shape
from simulation.truth import Truth
from tests.services.sheet.developable.sheets import (
    BASIS,
    BENT,
    FLAT,
    PAGE,
    Bent,
    box,
    half_diagonal,
    sheet_of,
)

STRONG = Bent(bends=(1.0, 2.0, 2.5, 1.0, -1.5, -2.5, -1.0, 0.5))


def in_space(surface: DevelopableSurface, page: Points) -> Floats:
    """Points (N, 3) in the camera frame of page points (N, 2)."""
    sheet = surface.to_sheet(page)
    P, R = surface.line_at(sheet[:, 0])
    return np.asarray(P + sheet[:, 1:] * R)


def rates(surface: DevelopableSurface, page: Points, step: float = 1e-4) -> tuple[Floats, Floats]:
    """dX/du and dX/dv (N, 3) by central differences."""
    u, v = step * np.eye(2)
    return (
        (in_space(surface, page + u) - in_space(surface, page - u)) / (2 * step),
        (in_space(surface, page + v) - in_space(surface, page - v)) / (2 * step),
    )


@given(BENT)
@settings(max_examples=60)
def test_the_sheet_is_neither_stretched_nor_sheared(bent: Bent) -> None:
    surface = bent.surface()
    along, down = rates(surface, PAGE)
    # The table's step is 0.017 and k at most 1: chords are shorter than arcs by (k step)^2 / 8.
    assert np.allclose(np.linalg.norm(along, axis=1), 1, atol=1e-4)
    assert np.allclose(np.linalg.norm(down, axis=1), 1, atol=1e-4)
    assert np.allclose(np.einsum("ij,ij->i", along, down), 0, atol=1e-4)
    normals = np.cross(along, down)
    seen = surface.to_photo(PAGE)
    assert np.allclose(surface.normals(seen), normals, atol=2e-3)
    assert (np.einsum("ij,ij->i", normals, in_space(surface, PAGE)) > 0).all()


@given(BENT)
@settings(max_examples=60)
def test_photo_and_page_are_inverse(bent: Bent) -> None:
    surface = bent.surface()
    seen = surface.to_photo(PAGE)
    assert np.allclose(surface.to_page(seen), PAGE, atol=1e-9)
    X = in_space(surface, PAGE)
    assert np.allclose(surface.focal * X[:, :2] / X[:, 2:], seen, atol=1e-9)
    at = surface.unroll(seen)
    assert np.allclose(at.X, X, atol=1e-9)
    assert np.allclose(at.sheet, surface.to_sheet(PAGE), atol=1e-9)
    assert np.allclose(surface.from_sheet(at.sheet), PAGE, atol=1e-9)


@pytest.mark.pipeline
@given(BENT)
@settings(max_examples=60)
def test_jacobians_are_the_derivatives_of_the_page(bent: Bent) -> None:
    surface = bent.surface()
    seen, step = surface.to_photo(PAGE), 1e-5
    d = step * np.eye(2)
    slow = np.stack([(surface.to_page(seen + e) - surface.to_page(seen - e)) / (2 * step) for e in d], axis=2)
    size = np.linalg.norm(slow, axis=(1, 2)).max()
    assert np.abs(surface.jacobians(seen) - slow).max() < 3e-4 * size


@given(BENT, st.integers(0, len(PAGE) - 1))
@settings(max_examples=30)
def test_a_point_is_unrolled_as_if_alone(bent: Bent, one: int) -> None:
    surface = bent.surface()
    seen = surface.to_photo(PAGE)
    assert np.allclose(surface.to_page(seen[one : one + 1]), PAGE[one : one + 1], atol=1e-9)
    mixed = np.concatenate([seen, seen[:3] + 3.0])
    assert np.allclose(surface.to_page(mixed)[: len(PAGE)], PAGE, atol=1e-9)


def test_the_origin_is_seen_at_the_anchor_at_unit_scale() -> None:
    for bent in (Bent(), STRONG, FLAT):
        surface = bent.surface()
        origin = np.zeros((1, 2))
        # The origin lies between two nodes 0.015 apart.
        assert np.allclose(surface.to_photo(origin)[0], bent.anchor, atol=5e-5)
        assert np.allclose(in_space(surface, origin)[0], [*bent.anchor, bent.focal], atol=5e-5)
        # At the origin the text's axes are the columns of the turn, and the skew does not move them.
        along, down = rates(surface, origin)
        assert np.allclose(np.stack([along[0], down[0]], axis=1), rotation_from_vector(np.array(bent.turn))[:, :2],
                           atol=1e-3)  # fmt: skip


@pytest.mark.parametrize("skew", [0.0, 0.7, -1.2, np.pi / 2])
@pytest.mark.parametrize("slopes", [(0.0, 0.0), (0.4, -0.2)])
def test_a_sheet_without_bends_is_a_plane(skew: float, slopes: tuple[float, float]) -> None:
    bent = replace(FLAT, skew=skew, slopes=slopes)
    surface = bent.surface()
    R = rotation_from_vector(np.array(bent.turn))
    f = bent.focal
    H = np.diag([f, f, 1.0]) @ np.column_stack([R[:, 0], R[:, 1], [*bent.anchor, f]]) / f
    plane = PlaneMap(H)
    assert np.allclose(surface.to_photo(PAGE), plane.to_photo(PAGE), atol=1e-9)
    seen = plane.to_photo(PAGE)
    assert np.allclose(surface.to_page(seen), plane.to_page(seen), atol=1e-9)
    assert np.allclose(surface.jacobians(seen), plane.jacobians(seen), atol=1e-9)
    assert np.allclose(surface.normals(seen), R[:, 2], atol=1e-9)
    centred = replace(bent, anchor=(0.0, 0.0)).surface()
    assert np.allclose(centred.to_photo(PAGE), transform_points(plane_to_image(R, f), PAGE), atol=1e-9)


@pytest.mark.parametrize("k", [1.5, -0.8])
def test_a_constant_bend_is_a_circular_cylinder(k: float) -> None:
    bent = replace(FLAT, turn=(0.0, 0.0, 0.0), anchor=(0.1, -0.2), skew=0.0, bends=(k,) * 8)
    surface = bent.surface()
    u, v = PAGE.T
    X = in_space(surface, PAGE) - [0.1, -0.2, bent.focal]
    # A positive bend turns the sheet's sides towards the camera.
    assert np.allclose(X[:, 0], np.sin(k * u) / k, atol=1e-4)
    assert np.allclose(X[:, 1], v, atol=1e-12)
    assert np.allclose(X[:, 2], -(1 - np.cos(k * u)) / k, atol=1e-4)
    axis = np.hypot(X[:, 0], X[:, 2] + 1 / k)
    assert np.allclose(axis, 1 / abs(k), atol=1e-4)
    assert np.allclose(
        surface.normals_at(u), np.stack([np.sin(k * u), 0 * u, np.cos(k * u)], axis=1), atol=1e-4
    )


@pytest.mark.parametrize("w", [0.4, -0.7])
def test_linear_slopes_make_all_rulings_meet_in_one_point(w: float) -> None:
    surface = replace(STRONG, slopes=(w, 0.0), skew=0.0).surface()
    s = np.linspace(-0.6, 0.6, 13)
    on_sheet = surface.from_sheet(np.stack([s, np.full(13, -1 / w)], axis=1))
    assert np.allclose(on_sheet, [0.0, -1 / w], atol=1e-12)
    P, R = surface.line_at(s)
    assert np.allclose(P - R / w, (P - R / w)[0], atol=2e-3)
    # Parallel rulings never meet, and a second order moves the meeting point along.
    P, R = replace(STRONG, slopes=(0.0, 0.0)).surface().line_at(s)
    assert np.allclose(R, R[0], atol=1e-9)
    P, R = replace(STRONG, slopes=(w, 0.5)).surface().line_at(s)
    assert np.ptp(P - R / w, axis=0).max() > 0.1


@given(BENT)
@settings(max_examples=40)
def test_rulings_are_straight_lines_of_the_sheet(bent: Bent) -> None:
    surface = bent.surface()
    t = np.linspace(-0.4, 0.4, 5)
    for s in (-0.3, 0.0, 0.25):
        sheet = np.stack([np.full(5, s), t], axis=1)
        page = surface.from_sheet(sheet)
        assert np.allclose(surface.to_sheet(page), sheet, atol=1e-9)
        # On the flat sheet: from (s, 0) on, at the slope w to the b-axis.
        c, d = np.cos(bent.skew), np.sin(bent.skew)
        a, b = page @ [c, -d], page @ [d, c]
        w = bent.slopes[0] * s + bent.slopes[1] * s * s
        assert np.allclose(a, s + t * w, atol=1e-12)
        assert np.allclose(b, t, atol=1e-12)
        X = in_space(surface, page)
        assert np.allclose(X, X[0] + (t - t[0])[:, None] / (t[-1] - t[0]) * (X[-1] - X[0]), atol=1e-9)
        P, R = surface.line_at(np.array([s]))
        assert np.allclose(X, P + t[:, None] * R, atol=1e-12)
        assert np.allclose(np.linalg.norm(R), np.hypot(1, w), atol=1e-4)


SHAPES: dict[str, Shape] = {
    "book": BOOK,
    "wave": WAVE,
    "bent": CURVATURE_SERIES[4],
    "cone": CONE,
    "hollow cone": Cone((-3.0, 1.0), 0.6, -1),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("skew_deg", [0.0, -15.0])
def test_simulated_pages_are_surfaces_of_the_model(name: str, skew_deg: float) -> None:
    page = Page(np.full((625, 400), 255, np.uint8))
    view = POSES[1]
    camera = view.camera(525, 675)
    truth = Truth(
        page, SHAPES[name], float(np.radians(skew_deg)), view.pose(page, SHAPES[name], camera), camera
    )
    surface, unit = sheet_of(truth), half_diagonal(truth)
    grid = box(190.0, 300.0, 15, 21) + np.array([199.5, 312.0])
    photo = truth.page_to_photo(grid)
    on_page = truth.on_page(photo)
    grid, photo = grid[on_page], photo[on_page]
    centred = (photo - camera.principal_point) / unit
    # Half a page's width in the model's unit: as it is seen at the depth of the sheet's centre.
    half_width = truth.focal_length_px / truth.pose.translation[2] / unit
    expected = (grid - [199.5, 312.0]) / page.half_width_px * half_width
    assert np.allclose(surface.to_page(centred), expected, atol=1e-3 * half_width)
    assert np.allclose(surface.to_photo(expected), centred, atol=1e-3 * half_width)
    assert np.allclose(surface.normals(centred), truth.normals(photo), atol=2e-3)
    _, R = surface.line_at(surface.unroll(centred).sheet[:, 0])
    R = R / np.linalg.norm(R, axis=1, keepdims=True)
    assert np.abs(np.einsum("ij,ij->i", R, truth.rulings_3d(photo))).min() > 1 - 1e-5


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("roll", [2.6, -2.6])
def test_what_lies_beyond_the_front_never_disturbs_the_page(side: float, roll: float) -> None:
    # Beside the page the sheet turns by more than half a circle, and goes back across it, before or behind.
    low, high = (-0.6, 2.4) if side > 0 else (-2.4, 0.6)
    basis = bend_basis(low, high, 16, 0.3)
    bends = np.zeros(16)
    bends[8:14] = roll
    bent = Bent(
        turn=(0.1, 0.1, 0.0), skew=0.0, slopes=(0.05, 0.0), bends=tuple(bends if side > 0 else bends[::-1])
    )
    surface = bent.surface(basis)
    turned = np.einsum("ij,ij->i", surface.N, surface.P) <= 0
    assert turned.sum() > 10
    assert not turned[surface.front[0] : surface.front[1] + 1].any()
    back = surface.focal * surface.P[turned, 0] / surface.P[turned, 2]
    seen = surface.to_photo(PAGE)
    assert ((back * side < (seen[:, 0] * side).max()) & (surface.P[turned, 2] > 0)).any()
    assert np.allclose(surface.to_page(seen), PAGE, atol=1e-9)
    far = surface.from_sheet(np.stack([surface.basis.nodes[turned], np.zeros(turned.sum())], axis=1))
    assert np.isnan(surface.to_photo(far)).all()


def test_the_page_ends_where_rulings_cross() -> None:
    surface = replace(FLAT, slopes=(1.0, 0.0), skew=0.0, turn=(0.0, 0.0, 0.0)).surface()
    v = np.array([-1.2, -0.95, -0.91, -0.89, -0.5, 0.5])
    seen = surface.to_photo(np.stack([np.full(6, 0.02), v], axis=1))
    # Rulings meet at v = -1; a tenth of their distance before, the page ends.
    assert np.isnan(seen).all(axis=1).tolist() == [True, True, True, False, False, False]
    assert np.isfinite(seen[3:]).all()


@pytest.mark.parametrize("slopes", [(0.4, 0.9), (-0.3, 0.8), (0.0, -1.2), (0.6, 0.0)])
def test_what_is_seen_lies_on_the_ruling_through_it(slopes: tuple[float, float]) -> None:
    surface = replace(FLAT, slopes=slopes, skew=0.1, turn=(0.0, 0.0, 0.0)).surface()
    u, v = np.meshgrid(np.linspace(-1.5, 1.5, 25), np.linspace(-1.5, 1.5, 25))
    page = np.stack([u.ravel(), v.ravel()], axis=1)
    is_seen = np.isfinite(surface.to_photo(page)).all(axis=1)
    assert 50 < is_seen.sum() < len(page)  # some rulings cross within
    assert np.allclose(surface.from_sheet(surface.to_sheet(page[is_seen])), page[is_seen], atol=1e-9)


def test_the_page_ends_behind_the_camera() -> None:
    surface = replace(FLAT, turn=(0.0, 1.2, 0.0), focal=1.0, anchor=(0.0, 0.0), skew=0.0).surface()
    depth = in_space(surface, np.array([[1.0, 0.0], [1.5, 0.0], [-1.0, 0.0]]))[:, 2]
    assert depth[1] < 0 < depth[0]
    seen = surface.to_photo(np.array([[1.0, 0.0], [1.5, 0.0], [-1.0, 0.0]]))
    assert np.isnan(seen[1]).all()
    assert np.isfinite(seen[[0, 2]]).all()


def test_the_sheet_goes_on_straight_beyond_its_bends() -> None:
    surface = Bent(slopes=(0.0, 0.0), skew=0.0, anchor=(0.0, 0.0), turn=(0.0, 0.0, 0.0)).surface()
    for side in (-1, 1):
        # Within the table, at its end, and beyond.
        u = side * np.array([1.05, 1.2, 1.4, 1.6, 2.0])
        X = in_space(surface, np.stack([u, np.zeros(5)], axis=1))
        way = np.diff(X, axis=0) / np.diff(u)[:, None]
        assert np.allclose(way, way[0], atol=1e-6)
        assert np.linalg.norm(way[0]) == pytest.approx(1.0, abs=1e-6)
    beyond = np.array([[1.7, 0.3], [1.7, -0.3]])
    assert np.allclose(surface.to_page(surface.to_photo(beyond)), beyond, atol=1e-6)


@pytest.mark.parametrize("count", [4, 5, 12])
def test_splines_are_a_partition_of_unity_on_their_span(count: int) -> None:
    basis = bend_basis(-0.3, 0.9, count, 0.25)
    assert basis.values.shape == (len(basis.nodes), count)
    assert basis.nodes[0] == pytest.approx(-0.6)
    assert basis.nodes[-1] == pytest.approx(1.2)
    inside = (basis.nodes >= -0.3) & (basis.nodes <= 0.9)
    assert np.allclose(basis.values[inside].sum(axis=1), 1)
    assert not basis.values[~inside].any()
    middle = 0.5 * (basis.nodes[1:] + basis.nodes[:-1])
    inside = (middle >= -0.3) & (middle <= 0.9)
    assert np.allclose(basis.midpoints[inside].sum(axis=1), 1)
    assert not basis.midpoints[~inside].any()
    # Cubic: any straight function of a is a combination.
    k = np.linalg.lstsq(basis.midpoints[inside], 2 * middle[inside] + 1, rcond=None)[0]
    assert np.allclose(basis.midpoints[inside] @ k, 2 * middle[inside] + 1)


def test_rotations_are_rodrigues() -> None:
    vectors = np.random.default_rng(0).normal(0, 1, (20, 3))
    vectors[3] = 0.0
    for found, vector in zip(rotations(vectors), vectors, strict=True):
        assert np.allclose(found, rotation_from_vector(vector), atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 3, 7, 8, 159])
def test_running_products_are_products(count: int) -> None:
    factors = rotations(np.random.default_rng(1).normal(0, 0.3, (count, 3)))
    total = np.eye(3)
    for factor, found in zip(factors, running_products(factors), strict=True):
        total = total @ factor
        assert np.allclose(found, total, atol=1e-12)


def test_a_finer_table_changes_nothing_that_is_seen() -> None:
    coarse = STRONG.surface()
    fine: BendBasis = bend_basis(-1.0, 1.0, 8, 0.3, tabulated=1600)
    assert len(fine.nodes) == 10 * len(BASIS.nodes)
    off = STRONG.surface(fine).to_photo(PAGE) - coarse.to_photo(PAGE)
    # A tenth of a pixel of a photo of 12 megapixels is 4e-5.
    assert np.abs(off).max() < 4e-4
    # Nodes are counted for each point, more than a byte holds.
    seen = coarse.to_photo(PAGE)
    assert np.abs(STRONG.surface(fine).to_page(seen) - PAGE).max() < 2e-3
