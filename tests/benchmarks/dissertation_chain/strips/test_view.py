"""The flat view: strips of a plane are one homography, those of a cylinder unroll it; the map goes both ways."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.dissertation_chain.strips.strip_map import StripMap
from benchmarks.dissertation_chain.strips.view import (
    ViewParameters,
    chain_strips,
    strips_of,
    trace_rows,
    unroll_strips,
)
from services.geometry.camera import plane_to_image
from services.geometry.homographies import transform_points
from tests.benchmarks.dissertation_chain.strips.bent_page import BentPage, similarity_residual

COUNT = 24
FLAT = BentPage(radius=np.inf, skew_rad=0.2)
BENT = BentPage(skew_rad=0.1)


def view_of(page: BentPage) -> StripMap:
    evidence, normals = page.evidence(COUNT), page.normals(page.strip_middles(COUNT))
    view = unroll_strips(evidence, normals, page.focal, page.characters())
    assert view is not None
    return view


def page_lattice(reach: float = 0.95, count: int = 15) -> np.ndarray:
    axis = np.linspace(-reach, reach, count)
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


def test_strips_of_a_plane_are_one_planar_rectification() -> None:
    evidence, normals = FLAT.evidence(COUNT), FLAT.normals(FLAT.strip_middles(COUNT))
    chain = chain_strips(evidence, normals, FLAT.focal)
    T, B = FLAT.text_flows(np.zeros(1))
    planar = plane_to_image(np.column_stack([T[0], B[0], normals[0]]), FLAT.focal)
    points = FLAT.see(page_lattice())
    expected = transform_points(np.linalg.inv(planar), points)
    views = [transform_points(H, points) for H in chain.H_page_centred]
    for view in views:
        np.testing.assert_allclose(view, views[0], atol=1e-9)
    assert similarity_residual(views[0], expected) < 1e-9


def test_each_strip_takes_its_reference_points_to_where_the_chain_put_them() -> None:
    evidence, normals = BENT.evidence(COUNT), BENT.normals(BENT.strip_middles(COUNT))
    chain = chain_strips(evidence, normals, BENT.focal)
    for i in range(COUNT):
        ends = transform_points(chain.H_page_centred[i], evidence.reference_points[i : i + 2])
        np.testing.assert_allclose(ends, chain.page_points[i : i + 2], atol=1e-9)
        np.testing.assert_allclose(chain.H_page_centred[i] @ chain.H_centred_page[i], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(chain.page_points[0], 0.0)


def test_the_chain_has_the_true_widths() -> None:
    page = BentPage()
    chain = chain_strips(page.evidence(COUNT), page.normals(page.strip_middles(COUNT)), page.focal)
    widths = np.linalg.norm(np.diff(chain.points, axis=0), axis=1)
    np.testing.assert_allclose(widths / widths.mean(), 1.0, atol=1e-6)


@pytest.mark.parametrize(
    "page", [BentPage(), BENT, BentPage(radius=-0.9, azimuth_rad=4.0, skew_rad=-0.2), FLAT]
)
def test_a_bent_page_unrolls_to_itself(page: BentPage) -> None:
    page_points = page_lattice()
    found = view_of(page).to_page(page.see(page_points))
    truth = page.text_frame(page_points)
    assert np.all(np.isfinite(found))
    # In half page widths; rulings 24ths of the page apart.
    assert similarity_residual(found, truth) < 3e-3


def test_text_lines_come_out_horizontal() -> None:
    c, s = np.cos(BENT.skew_rad), np.sin(BENT.skew_rad)
    along = np.linspace(-0.8, 0.8, 30)[:, None] * [c, s]
    for height in (-0.5, 0.0, 0.5):
        line = view_of(BENT).to_page(BENT.see(along + height * np.array([-s, c])))
        assert np.ptp(line[:, 1]) < 1e-3 * np.ptp(line[:, 0])
        assert np.all(np.diff(line[:, 0]) > 0)


def test_page_and_photo_are_inverse_to_each_other() -> None:
    view = view_of(BENT)
    photo = BENT.see(page_lattice())
    np.testing.assert_allclose(view.to_photo(view.to_page(photo)), photo, atol=1e-6)


def test_jacobians_are_the_derivatives_of_the_way_to_the_page() -> None:
    view = view_of(BENT)
    photo = BENT.see(page_lattice(0.8, 5))
    step = 1e-5
    numeric = np.stack(
        [(view.to_page(photo + d) - view.to_page(photo - d)) / (2 * step) for d in step * np.eye(2)], axis=-1
    )
    np.testing.assert_allclose(view.jacobians(photo), numeric, rtol=1e-3, atol=1e-3)


def test_the_map_goes_on_beyond_the_text_and_ends() -> None:
    view = view_of(BENT)
    beyond = view.to_page(BENT.see(np.array([[-1.2, 0.0], [1.2, 0.0], [0.0, -1.3], [0.0, 1.3]])))
    assert np.all(np.isfinite(beyond))
    far = np.array([[9.0, 0.0], [np.nan, 0.0]])
    assert np.all(np.isnan(view.to_page(far)))
    assert np.all(np.isnan(view.jacobians(far)))
    outside = np.array([[view.u[0] - 0.1, view.v.mean()], [view.u.mean(), view.v[-1] + 0.1]])
    assert np.all(np.isnan(view.to_photo(outside)))
    assert view.to_page(np.zeros((0, 2))).shape == (0, 2)


def test_rows_meet_on_the_rulings() -> None:
    evidence, normals = BENT.evidence(COUNT), BENT.normals(BENT.strip_middles(COUNT))
    chain = chain_strips(evidence, normals, BENT.focal)
    left, right = trace_rows(evidence, chain, np.linspace(-0.3, 0.3, 5))
    for i in range(COUNT - 1):
        leaving = transform_points(chain.H_centred_page[i], right[i])
        np.testing.assert_allclose(
            leaving, transform_points(chain.H_centred_page[i + 1], left[i + 1]), atol=1e-9
        )
        p, r = evidence.reference_points[i + 1], evidence.rulings[i + 1]
        assert np.abs((leaving - p) @ [-r[1], r[0]]).max() < 1e-6
    np.testing.assert_allclose(left[..., 1], right[..., 1], atol=1e-12)


def test_points_belong_to_the_strip_that_they_lie_in() -> None:
    middles = BENT.strip_middles(COUNT)
    inside = np.stack([middles, np.full(COUNT, 0.6)], axis=1)
    np.testing.assert_array_equal(strips_of(BENT.evidence(COUNT), BENT.see(inside)), np.arange(COUNT))
    beside = BENT.see(np.array([[-1.3, 0.0], [1.3, 0.0]]))
    np.testing.assert_array_equal(strips_of(BENT.evidence(COUNT), beside), [0, COUNT - 1])


def test_whatever_the_normals_the_map_is_finite_or_none() -> None:
    rng = np.random.default_rng(0)
    evidence = BENT.evidence(COUNT)
    truth = BENT.normals(BENT.strip_middles(COUNT))
    views = []
    for noise in (0.05, 0.1, 0.2, 0.4, 1.0, 3.0):
        normals = truth + rng.normal(0, noise, truth.shape)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        views.append(unroll_strips(evidence, normals, BENT.focal, BENT.characters()))
    assert views[0] is not None
    assert views[-1] is None
    for view in views:
        if view is not None:
            assert np.all(np.isfinite(view.photo))
            assert np.all(np.diff(view.u) > 0)
            assert np.all(np.diff(view.v) > 0)


def test_rulings_that_cross_within_the_text_keep_their_order() -> None:
    evidence = BENT.evidence(COUNT)
    rulings = evidence.rulings.copy()
    rulings[10:13] = evidence.rulings[10:13] @ [[0.97, 0.243], [-0.243, 0.97]]
    normals = BENT.normals(BENT.strip_middles(COUNT))
    view = unroll_strips(replace(evidence, rulings=rulings), normals, BENT.focal, BENT.characters())
    assert view is not None
    assert np.all(np.isfinite(view.photo))


def test_the_margin_ends_before_the_camera() -> None:
    """An end strip that comes steeply towards the camera is not continued to behind it."""
    page = BentPage(radius=-0.8, tilt_rad=0.3, distance=2.2, azimuth_rad=0.0)
    view = view_of(page)
    assert np.abs(view.photo).max() < 10
    corners = np.array([[view.u[0], view.v[0]], [view.u[-1], view.v[-1]]])
    assert np.all(np.isfinite(view.to_photo(corners)))


def test_one_strip_and_no_characters_still_have_a_view() -> None:
    evidence = FLAT.evidence(1)
    view = unroll_strips(evidence, FLAT.normals(np.zeros(1)), FLAT.focal, np.zeros((0, 2)), ViewParameters())
    assert view is not None
    found = view.to_page(FLAT.see(page_lattice(0.9)))
    assert similarity_residual(found, FLAT.text_frame(page_lattice(0.9))) < 1e-3
