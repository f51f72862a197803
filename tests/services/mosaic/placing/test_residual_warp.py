"""Displacements close what curvature leaves, leave what is flat, and keep within bounds whatever they are told."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from services.arrays import Homography, Points
from services.geometry.homographies import transform_points
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.placing.adjustment import residual_px
from services.mosaic.placing.placement import DisplacementField, Placement
from services.mosaic.placing.residual_warp import ResidualWarp, estimate_residual_warp
from services.mosaic.registration.pair_registration import PairRegistration
from services.sheet.plane.framing import FlatFrame
from tests.services.mosaic.synthetic_views import SIZE, grid, grid_views, match_all

pytestmark = pytest.mark.pipeline

TEXT_HEIGHT = 20.0


def flat_photos(views: Mapping[int, Homography]) -> dict[int, FlatPhoto]:
    """Photos of which only the sizes matter here."""
    width, height = SIZE
    gray, shown = np.full((height, width), 255, np.uint8), np.ones((height, width), bool)
    photo = np.broadcast_to(np.uint8(255), (height, width, 3))
    frame = FlatFrame(np.eye(3), width, height)
    return {k: FlatPhoto(k, photo, frame, gray, shown, TEXT_HEIGHT, 1.0, 100.0) for k in views}


def wave(flat: Points, index: int, size_px: float) -> Points:
    """What a curved page adds to a view, flat pixels (N, 2); each view has its own."""
    x, y = flat.T
    down = np.sin(x / 300 + index) + 0.5 * np.cos(y / 400 - index)
    return size_px * np.stack([0.3 * np.cos(x / 350 + 2 * index), down], axis=1)


def curved_pairs(
    rng: np.random.Generator, views: dict[int, Homography], size_px: float, noise_px: float
) -> list[PairRegistration]:
    """Matches in views whose points were displaced by `wave`."""
    pairs = []
    for pair in match_all(rng, views, noise_px, count=500):
        points_a = pair.points_a + wave(pair.points_a, pair.a, size_px)
        points_b = pair.points_b + wave(pair.points_b, pair.b, size_px)
        pairs.append(replace(pair, points_a=points_a, points_b=points_b))
    return pairs


def placements(views: Mapping[int, Homography], warp: ResidualWarp) -> dict[int, Placement]:
    """Views with their displacements."""
    return {k: Placement(H, warp.displacements[k]) for k, H in views.items()}


def fresh_residual(views: dict[int, Homography], placed: Mapping[int, Placement], size_px: float) -> float:
    """Greatest RMS of a pair over exact matches that were not fitted."""
    pairs = curved_pairs(np.random.default_rng(99), views, size_px, 0.0)
    return max(residual_px(pair, placed[pair.a], placed[pair.b]) for pair in pairs)


@pytest.mark.parametrize("noise_px", [0.0, 0.3])
def test_curvature_is_closed_in_the_overlaps(noise_px: float) -> None:
    rng = np.random.default_rng(1)
    views = grid_views(rng, 2, 2)
    warp = estimate_residual_warp(flat_photos(views), views, curved_pairs(rng, views, 3.0, noise_px))
    assert warp.before_px > 2
    assert warp.after_px < 0.3 * warp.before_px
    if noise_px:
        assert warp.after_px > 0.5 * noise_px
    plain = {k: Placement(H) for k, H in views.items()}
    before, after = (fresh_residual(views, placed, 3.0) for placed in (plain, placements(views, warp)))
    assert after < 0.15 * before


def test_every_photo_gives_way_and_none_far_from_the_overlaps() -> None:
    rng = np.random.default_rng(2)
    views = grid_views(rng, 1, 2, overlap=0.2)
    warp = estimate_residual_warp(flat_photos(views), views, curved_pairs(rng, views, 3.0, 0.1))
    fields = [field for field in warp.displacements.values() if field is not None]
    assert len(fields) == 2
    left, right = (np.linalg.norm(field.nodes, axis=2) for field in fields)
    assert 0.5 < left.max() / right.max() < 2
    # The overlap lies at the right of the left view.
    assert left[:, 0].max() < 0.2 * left[:, -1].max()
    assert right[:, -1].max() < 0.2 * right[:, 0].max()


def test_a_view_that_shows_an_error_gives_way_to_one_that_shows_none() -> None:
    rng = np.random.default_rng(2)
    views = grid_views(rng, 1, 2, overlap=0.2)
    pairs = curved_pairs(rng, views, 3.0, 0.1)
    photos = flat_photos(views)
    errors = dict(zip(views, (0.1, 0.6), strict=True))
    judged = {k: replace(photo, error_percent=errors[k]) for k, photo in photos.items()}
    warp = estimate_residual_warp(judged, views, pairs)
    good, bad = (field for field in warp.displacements.values() if field is not None)
    moved = [float(np.linalg.norm(field.nodes, axis=2).max()) for field in (good, bad)]
    assert moved[0] < 0.15 * moved[1]
    assert warp.after_px < 0.3 * warp.before_px


@pytest.mark.parametrize("noise_px", [0.1, 0.8])
def test_flat_pages_stay_as_they_are(noise_px: float) -> None:
    rng = np.random.default_rng(3)
    views = grid_views(rng, 2, 2)
    warp = estimate_residual_warp(flat_photos(views), views, match_all(rng, views, noise_px, count=500))
    assert all(field is None for field in warp.displacements.values())
    assert warp.after_px == warp.before_px == pytest.approx(noise_px * 2**0.5, rel=0.4)


def test_one_curled_photo_among_flat_ones() -> None:
    rng = np.random.default_rng(4)
    views = grid_views(rng, 2, 3)
    pairs = []
    for pair in match_all(rng, views, 0.1, count=400):
        curled = pair.points_b + (wave(pair.points_b, 5, 3.0) if pair.b == 5 else 0.0)
        pairs.append(replace(pair, points_b=curled))
    warp = estimate_residual_warp(flat_photos(views), views, pairs)
    assert warp.before_px > 1.5
    assert warp.after_px < 0.4 * warp.before_px


def test_bounds_hold_under_wrong_matches() -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        views = grid_views(rng, 2, 2)
        pairs = []
        for pair in curved_pairs(rng, views, 2.0, 0.2):
            points = pair.points_b.copy()
            wrong = rng.random(len(points)) < 0.2
            points[wrong] += rng.uniform(-40, 40, (int(wrong.sum()), 2))
            pairs.append(replace(pair, points_b=points))
        warp = estimate_residual_warp(flat_photos(views), views, pairs)
        for field in warp.displacements.values():
            if field is not None:
                check_bounds(field)
        placed = placements(views, warp)
        assert fresh_residual(views, placed, 2.0) < 0.6 * fresh_residual(
            views, {k: Placement(H) for k, H in views.items()}, 2.0
        )


def check_bounds(field: DisplacementField) -> None:
    """Within a text height, no fold, and an inverse that comes back."""
    points = grid(80, 60)
    moved = points + field.at(points)
    assert np.linalg.norm(moved - points, axis=1).max() < 1.3 * TEXT_HEIGHT
    mesh = moved.reshape(60, 80, 2)
    across, down = np.diff(mesh, axis=1)[:-1], np.diff(mesh, axis=0)[:, :-1]
    turned = across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0]
    step = (SIZE[0] - 1) / 79 * (SIZE[1] - 1) / 59
    assert turned.min() > 0.85 * step
    assert turned.max() < 1.15 * step
    placement = Placement(np.array([[0.9, 0.1, 30.0], [-0.1, 1.1, 5.0], [1e-5, 2e-5, 1.0]]), field)
    assert np.abs(placement.to_flat(placement.to_mosaic(points)) - points).max() < 1e-3


def test_a_step_is_not_bridged() -> None:
    """A page that is torn, or two lines mistaken for each other: no smooth field explains it within its bounds."""
    rng = np.random.default_rng(5)
    views = grid_views(rng, 1, 2)
    pairs = []
    for pair in match_all(rng, views, 0.1, count=800):
        points = pair.points_b + np.where(pair.points_b[:, 1:] // 60 % 2 > 0, 9.0, -9.0) * [0.0, 1.0]
        pairs.append(replace(pair, points_b=points))
    warp = estimate_residual_warp(flat_photos(views), views, pairs)
    for field in warp.displacements.values():
        if field is not None:
            check_bounds(field)


def test_order_of_photos_and_pairs_does_not_matter() -> None:
    rng = np.random.default_rng(6)
    views = grid_views(rng, 2, 2)
    pairs = curved_pairs(rng, views, 3.0, 0.2)
    first = placements(views, estimate_residual_warp(flat_photos(views), views, pairs))
    turned_round = {k: views[k] for k in reversed(views)}
    second = placements(views, estimate_residual_warp(flat_photos(views), turned_round, pairs[::-1]))
    for k in views:
        assert np.abs(first[k].to_mosaic(grid()) - second[k].to_mosaic(grid())).max() < 1e-6


def test_no_pairs_no_displacement() -> None:
    views = grid_views(np.random.default_rng(7), 1, 2)
    warp = estimate_residual_warp(flat_photos(views), views, [])
    assert warp.displacements == {0: None, 1: None}


def test_the_frame_does_not_drift() -> None:
    rng = np.random.default_rng(8)
    views = grid_views(rng, 2, 2)
    warp = estimate_residual_warp(flat_photos(views), views, curved_pairs(rng, views, 3.0, 0.1))
    placed = placements(views, warp)
    moved = [placed[k].to_mosaic(grid(30, 30)) - transform_points(H, grid(30, 30)) for k, H in views.items()]
    # The waves are 3 px high; what all photos do together stays below one.
    assert np.linalg.norm(np.concatenate(moved).mean(axis=0)) < 1.0
