"""The frame that all views agree on: right on average, robust, the same in any order and from any world."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.arrays import Homography, Points
from services.geometry.homographies import scaling, transform_points, translation
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.placing.frontal_frame import FrontalFrame, agree_on_frontal_frame
from services.sheet.plane.framing import FlatFrame
from tests.services.mosaic.synthetic_views import SIZE, grid, grid_views, imperfection

pytestmark = pytest.mark.pipeline

WORLD = np.array([[0.9, 0.15, 40.0], [-0.1, 1.1, -300.0], [3e-5, -5e-5, 1.0]])
"""The world of the adjustment as seen from the page: any homography will do."""


def flat_photo(index: int, weight: float = 100.0, native_scale: float = 1.0) -> FlatPhoto:
    """A photo of which only the sizes matter here."""
    width, height = SIZE
    gray = np.full((height, width), 255, np.uint8)
    photo = np.broadcast_to(np.uint8(255), (height, width, 3))
    return FlatPhoto(
        index,
        photo,
        FlatFrame(np.eye(3), width, height),
        gray,
        np.ones((height, width), bool),
        20.0,
        native_scale,
        weight,
    )


def agree(
    views: dict[int, Homography], weights: dict[int, float] | None = None, world: Homography = WORLD
) -> FrontalFrame:
    """The frame of `views` (H_page_flat) as the adjustment would hand them on."""
    photos = {k: flat_photo(k, (weights or {}).get(k, 100.0)) for k in views}
    return agree_on_frontal_frame(photos, {k: world @ H for k, H in views.items()})


def departure(H_mosaic_page: Homography, views: dict[int, Homography]) -> float:
    """RMS over what the views show after the best similarity, relative to the page's width."""
    page = np.concatenate([transform_points(H, grid()) for H in views.values()])
    found = transform_points(H_mosaic_page, page)
    z, w = page @ [1, 1j], found @ [1, 1j]
    rows = np.stack([w, np.ones_like(w)], axis=1)
    left = z - rows @ np.linalg.lstsq(rows, z, rcond=None)[0]
    return float(np.sqrt((np.abs(left) ** 2).mean()) / np.ptp(page[:, 0]))


def corners(frame: FrontalFrame, H_world_flat: Homography) -> Points:
    """Mosaic pixels (4, 2) of a view's corners."""
    return transform_points(frame.H_mosaic_world @ H_world_flat, grid(2, 2))


def test_perfect_views_give_the_page() -> None:
    rng = np.random.default_rng(0)
    views = grid_views(rng, 2, 3, error=0.0)
    frame = agree(views)
    assert departure(frame.H_mosaic_world @ WORLD, views) < 1e-9
    assert max(frame.departures.values()) < 1e-9


def test_errors_of_rectification_average_out() -> None:
    agreed, single = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        views = grid_views(rng, 3, 3, error=0.003)
        agreed.append(departure(agree(views).H_mosaic_world @ WORLD, views))
        single.extend(departure(np.linalg.inv(views[k]), views) for k in views)
    # Nine views: a third of one view's error where errors only average, less since foreshortening has the longer lever.
    assert np.mean(agreed) < 0.4 * np.mean(single)


def test_of_two_views_the_weighted_mean() -> None:
    rng = np.random.default_rng(4)
    views = grid_views(rng, 1, 2, error=0.004)
    even = agree(views)
    heavy = agree(views, {0: 900.0, 1: 100.0})
    assert 0.5 < even.departures[0] / even.departures[1] < 2
    assert heavy.departures[0] < 0.5 * heavy.departures[1]
    assert heavy.trust[0] == pytest.approx(0.9)


@pytest.mark.parametrize("bad", [0, 2])
def test_one_bad_rectification_does_not_bend_the_page(bad: int) -> None:
    rng = np.random.default_rng(5)
    views = grid_views(rng, 2, 2, error=0.002)
    good = departure(agree(views).H_mosaic_world @ WORLD, views)
    views[bad] = views[bad] @ imperfection(rng, 0.08)
    frame = agree(views)
    assert frame.trust[bad] < 0.02
    assert departure(frame.H_mosaic_world @ WORLD, views) < 2 * good + 1e-3


def test_two_against_two_meet_in_the_middle() -> None:
    rng = np.random.default_rng(9)
    views = grid_views(rng, 2, 2, error=0.0)
    bent = imperfection(rng, 0.015)
    views = {k: bent @ H if k in (1, 3) else H for k, H in views.items()}
    trust = agree(views).trust
    assert 0.35 < trust[0] + trust[2] < 0.65


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 10**6))
def test_neither_order_nor_the_adjustment_s_world_matters(seed: int) -> None:
    rng = np.random.default_rng(seed)
    views = grid_views(rng, 2, 2, error=0.006)
    weights = {k: float(rng.uniform(50, 500)) for k in views}
    first = agree(views, weights)
    order = rng.permutation(len(views))
    moved = {int(order[k]): views[k] for k in rng.permutation(len(views))}
    other = np.linalg.inv(views[2])
    second = agree(moved, {int(order[k]): weights[k] for k in views}, other)
    assert (first.width, first.height) == (second.width, second.height)
    for H in views.values():
        assert np.abs(corners(first, WORLD @ H) - corners(second, other @ H)).max() < 1e-4


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_views_on_their_side_are_outvoted(quarters: int) -> None:
    rng = np.random.default_rng(6)
    views = grid_views(rng, 2, 2, error=0.001)
    straight = agree(views)
    turn = np.linalg.matrix_power(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), quarters)
    middle = translation((SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2)
    views[1] = views[1] @ middle @ turn @ np.linalg.inv(middle)
    turned = agree(views)
    for k in (0, 2, 3):
        edge = np.diff(corners(turned, WORLD @ views[k])[:2], axis=0)[0]
        assert abs(np.arctan2(edge[1], edge[0])) < 0.02
    assert departure(turned.H_mosaic_world @ WORLD, views) == pytest.approx(
        departure(straight.H_mosaic_world @ WORLD, views), abs=1e-3
    )


def test_all_views_on_their_side_stay_so() -> None:
    rng = np.random.default_rng(7)
    views = grid_views(rng, 1, 3, error=0.001)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    frame = agree({k: turn @ H for k, H in views.items()})
    for H in views.values():
        edge = np.diff(corners(frame, WORLD @ turn @ H)[:2], axis=0)[0]
        assert abs(np.arctan2(edge[1], edge[0])) < 0.02


def test_the_finest_photo_keeps_its_pixels_and_the_page_begins_at_zero() -> None:
    views = {0: np.eye(3), 1: translation(1000, 50) @ scaling(0.5)}
    photos = {0: flat_photo(0), 1: flat_photo(1, native_scale=0.8)}
    frame = agree_on_frontal_frame(photos, views)
    # Photo 1 shows half as much of the page, and its view 0.8 of its pixels.
    length = np.linalg.norm(np.diff(corners(frame, views[1])[:2], axis=0))
    assert length == pytest.approx((SIZE[0] - 1) / 0.8, rel=1e-6)
    every = np.concatenate([corners(frame, H) for H in views.values()])
    assert np.abs(every.min(axis=0)).max() < 1e-6
    assert np.abs(every.max(axis=0) - [frame.width - 1, frame.height - 1]).max() < 1.01


def test_photos_far_apart_make_no_huge_page() -> None:
    views = {0: np.eye(3), 1: translation(90000, 60000)}
    frame = agree(views)
    assert frame.width * frame.height < 4.1 * 2 * SIZE[0] * SIZE[1]
