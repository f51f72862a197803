"""Blocks are found where the truth is, to a fraction of a pixel, and nowhere else."""

from functools import cache

import numpy as np
import pytest

from services.geometry.homographies import transform_points, translation
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.registration.block_matching import match_blocks, support_blocks
from services.mosaic.registration.pair_verification import (
    PreparedPhoto,
    local_scale,
    refine_overlap,
    verify_overlap,
)
from services.mosaic.registration.reduced_view import ReducedView
from tests.services.mosaic.warped_views import (
    Flaws,
    draw_view,
    page,
    part,
    registration_error,
    true_homography,
)


@cache
def view_a() -> FlatPhoto:
    return draw_view(page(), part(0, 0), (800, 900))


@cache
def view_b() -> FlatPhoto:
    """It overlaps `view_a`."""
    return draw_view(page(), part(350, 150, 1.0, (0.004, -0.003, 0.4, -0.3)), (800, 900), 1, Flaws(seed=1))


def test_true_homography_finds_every_block_and_a_false_one_none() -> None:
    a, b = ReducedView(view_a(), 0, 0.5), ReducedView(view_b(), 0, 0.5)
    H = a.H_reduced_flat @ true_homography(view_a(), view_b()) @ np.linalg.inv(b.H_reduced_flat)
    true = match_blocks(a, b, translation(7, -5) @ H, 24)
    assert true.agreement > 0.95
    assert len(true.found) > 50
    np.testing.assert_allclose(true.displacements[true.found], [[7, -5]] * int(true.found.sum()), atol=0.5)
    false = match_blocks(a, b, translation(90, 70) @ H, 24)
    assert len(false.found) > 30
    assert false.agreement < 0.1


def test_no_block_where_views_do_not_meet_or_show_nothing() -> None:
    a, b = ReducedView(view_a(), 0, 0.5), ReducedView(view_b(), 0, 0.5)
    assert len(match_blocks(a, b, translation(5000, 0), 24).found) == 0
    blank = ReducedView(draw_view(np.full_like(page(), 255), part(0, 0), (800, 900)), 0, 0.5)
    assert len(match_blocks(blank, blank, np.eye(3), 24).found) == 0
    assert match_blocks(a, blank, np.eye(3), 24).agreement == 0.0


def test_neighbours_that_move_alike_support_each_other_and_a_stray_one_is_dropped() -> None:
    x, y = np.meshgrid(np.arange(0, 400, 40.0), np.arange(0, 200, 40.0))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    # Smooth and far from projective: a page that was not flat.
    displacements = np.stack([10 * np.sin(points[:, 0] / 120), 8 * np.cos(points[:, 0] / 150)], axis=1)
    assert support_blocks(points, displacements).all()
    displacements[17] += [0, 14]
    supported = support_blocks(points, displacements)
    assert not supported[17]
    assert np.count_nonzero(~supported) == 1


@pytest.mark.parametrize(
    ("scale", "flaws", "bound"),
    [
        (1.0, Flaws(seed=1), 0.06),
        (1.0, Flaws(blur_px=1.6, noise=6, gain=0.7, seed=1), 0.12),
        (1.5, Flaws(seed=1), 0.12),
        (0.7, Flaws(blur_px=1.0, noise=6, seed=1), 0.12),
    ],
)
def test_refined_registration_is_true_to_a_fraction_of_a_pixel(
    scale: float, flaws: Flaws, bound: float
) -> None:
    size = round(800 / scale), round(900 / scale)
    b = draw_view(page(), part(320.3, 210.7, scale, (0.004, -0.003, 0.4, -0.3)), size, 1, flaws)
    first, second = PreparedPhoto(view_a()), PreparedPhoto(b)
    start = translation(9, -7) @ true_homography(view_a(), b)
    overlap = verify_overlap(first, second, start, 0)
    assert overlap is not None
    assert overlap.blocks.agreement > 0.9
    refined = refine_overlap(first, second, overlap)
    assert refined is not None
    H, points_a, points_b, weights = refined
    assert registration_error(view_a(), b, H) < bound
    assert registration_error(view_a(), b, translation(0.3, 0) @ H) > 0.15
    apart = transform_points(true_homography(view_a(), b), points_b) - points_a
    assert np.sqrt(np.mean(apart**2)) < 2 * bound
    assert len(points_a) == len(points_b) == len(weights) > 40
    assert weights.min() > 0
    assert weights.max() <= 1
    assert abs(local_scale(H, b) / scale - 1) < 0.02


def test_smooth_displacements_are_kept_as_matches_though_no_homography_makes_them() -> None:
    # The page bent: rows shift by 6 px along a wave.
    paper = page()
    x = np.arange(paper.shape[1])
    bent = np.empty_like(paper)
    rows = np.clip(
        np.arange(paper.shape[0])[:, None] + np.round(6 * np.sin(x / 150)).astype(int), 0, len(paper) - 1
    )
    bent[:] = paper[rows, x[None, :]]
    b = draw_view(bent, part(100, 50), (800, 900), 1)
    overlap = verify_overlap(PreparedPhoto(view_a()), PreparedPhoto(b), true_homography(view_a(), b), 0)
    assert overlap is not None
    refined = refine_overlap(PreparedPhoto(view_a()), PreparedPhoto(b), overlap)
    assert refined is not None
    _, points_a, points_b, _ = refined
    moved = transform_points(true_homography(view_a(), b), points_b) - points_a
    expected = -6 * np.sin(points_a[:, 0] / 150)
    assert np.ptp(expected) > 8
    assert np.percentile(np.abs(moved[:, 1] - expected), 90) < 1.2


def test_three_comparisons_find_the_same_print_exactly() -> None:
    """Three plain steps leave 0.0055 px, six of them 0.0009."""
    photos = PreparedPhoto(view_a()), PreparedPhoto(view_a())
    overlap = verify_overlap(*photos, translation(0.4, 0.3), 0)
    assert overlap is not None
    refined = refine_overlap(*photos, overlap)
    assert refined is not None
    off = np.linalg.norm(refined[1] - refined[2], axis=1)
    assert float(np.median(off)) < 0.002
