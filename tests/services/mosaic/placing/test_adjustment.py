"""One adjustment of all photos: exact without noise, as good as the noise allows with it, whatever the order."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.arrays import Homography
from services.geometry.homographies import transform_points, translation
from services.mosaic.placing import adjustment
from services.mosaic.placing.adjustment import adjust_globally, residual_px
from services.mosaic.placing.placement import Placement
from tests.services.mosaic.synthetic_views import SIZE, grid, grid_views, match, match_all, renumber

pytestmark = pytest.mark.pipeline


def error_px(found: dict[int, Homography], true: dict[int, Homography]) -> float:
    """RMS over all views after the best homography of the world."""
    here = np.concatenate([transform_points(found[k], grid()) for k in true])
    there = np.concatenate([transform_points(true[k], grid()) for k in true])
    G, _ = cv2.findHomography(here, there, 0)
    return float(np.sqrt(((transform_points(G, here) - there) ** 2).sum(axis=1).mean()))


@pytest.mark.parametrize(("rows", "columns"), [(1, 2), (2, 2), (2, 4)])
def test_exact_without_noise(rows: int, columns: int) -> None:
    rng = np.random.default_rng(1)
    views = grid_views(rng, rows, columns, overlap=0.2)
    adjusted = adjust_globally(dict.fromkeys(views, SIZE), match_all(rng, views))
    assert adjusted.converged
    assert error_px(adjusted.H_world_flat, views) < 1e-3
    assert all(pair.kept_weight > 0.99 and not pair.contradicted for pair in adjusted.pairs)


def test_noise_is_averaged_but_not_hidden() -> None:
    errors, deviations = [], []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        views = grid_views(rng, 2, 3)
        adjusted = adjust_globally(dict.fromkeys(views, SIZE), match_all(rng, views, noise_px=0.2))
        errors.append(error_px(adjusted.H_world_flat, views))
        deviations.append(adjusted.deviation_px)
    assert np.mean(errors) < 0.2
    assert np.mean(errors) > 1e-6  # noise went in: it has not seen the truth
    assert np.mean(deviations) == pytest.approx(0.2, rel=0.1)


def test_a_loop_closes_better_than_its_chain() -> None:
    rng = np.random.default_rng(3)
    views = grid_views(rng, 2, 4, overlap=0.2)
    pairs = match_all(rng, views, noise_px=0.3, count=80)
    steps = {(0, 1), (1, 2), (2, 3), (3, 7), (6, 7), (5, 6), (4, 5)}
    chain = [pair for pair in pairs if (pair.a, pair.b) in steps]
    sizes = dict.fromkeys(views, SIZE)
    of_chain = error_px(adjust_globally(sizes, chain).H_world_flat, views)
    of_all = error_px(adjust_globally(sizes, pairs).H_world_flat, views)
    assert of_all < 0.5 * of_chain


@settings(max_examples=2, deadline=None)
@given(st.integers(0, 10**6))
def test_any_order_of_photos_and_pairs_gives_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    views = grid_views(rng, 2, 3)
    pairs = match_all(rng, views, noise_px=0.2, count=60)
    sizes = dict.fromkeys(views, SIZE)
    first = adjust_globally(sizes, pairs)
    order = rng.permutation(len(views))
    shuffled = renumber(pairs, order)
    again = adjust_globally(sizes, [shuffled[k] for k in rng.permutation(len(pairs))])
    moved_back = {k: again.H_world_flat[int(order[k])] for k in views}
    assert error_px(moved_back, first.H_world_flat) < 1e-3


def test_wrong_matches_within_a_pair_do_not_pull() -> None:
    rng = np.random.default_rng(5)
    views = grid_views(rng, 2, 2)
    pairs = []
    for pair in match_all(rng, views, noise_px=0.1):
        points = pair.points_b.copy()
        points[:60] += rng.uniform(-30, 30, (60, 2))
        pairs.append(replace(pair, points_b=points))
    adjusted = adjust_globally(dict.fromkeys(views, SIZE), pairs)
    assert error_px(adjusted.H_world_flat, views) < 0.15
    assert not any(pair.contradicted for pair in adjusted.pairs)


@pytest.mark.parametrize(("false", "offset"), [((0, 1), (120.0, 0.0)), ((0, 5), (0.0, 45.0))])
def test_a_pair_that_contradicts_the_rest_loses_its_say(
    false: tuple[int, int], offset: tuple[float, float]
) -> None:
    rng = np.random.default_rng(8)
    views = grid_views(rng, 2, 4)
    pairs = match_all(rng, views, noise_px=0.1)
    at = next(k for k, pair in enumerate(pairs) if (pair.a, pair.b) == false)
    # It has the strongest evidence of all, so that the first tree leads through it.
    wrong = match(rng, views, *false, noise_px=0.1, offset=offset)
    assert wrong is not None
    pairs[at] = replace(wrong, agreement=1.0)
    adjusted = adjust_globally(dict.fromkeys(views, SIZE), pairs)
    assert [(pair.a, pair.b) for pair in adjusted.pairs if pair.contradicted] == [false]
    assert error_px(adjusted.H_world_flat, views) < 0.3
    placed = [Placement(adjusted.H_world_flat[k]) for k in false]
    scale = np.hypot(*offset)
    assert 0.7 * scale < residual_px(pairs[at], *placed) < 1.4 * scale


def test_what_curvature_leaves_is_shared_not_rejected() -> None:
    rng = np.random.default_rng(2)
    views = grid_views(rng, 2, 2)
    pairs = []
    for pair in match_all(rng, views, noise_px=0.1):
        wave = 3 * np.sin(pair.points_b[:, :1] / 260) * np.array([[0.3, 1.0]])
        pairs.append(replace(pair, points_b=pair.points_b + wave))
    adjusted = adjust_globally(dict.fromkeys(views, SIZE), pairs)
    assert not any(pair.contradicted for pair in adjusted.pairs)
    assert min(pair.kept_weight for pair in adjusted.pairs) > 0.3
    assert error_px(adjusted.H_world_flat, views) < 5


def test_nearly_frontal_views_tell_what_a_strip_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    with_prior, without = [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        views = grid_views(rng, 1, 3, overlap=0.14, error=0.001)
        pairs = match_all(rng, views, noise_px=0.3, count=16)
        sizes = dict.fromkeys(views, SIZE)
        with_prior.append(error_px(adjust_globally(sizes, pairs).H_world_flat, views))
        with monkeypatch.context() as without_prior:
            without_prior.setattr(adjustment, "PRIOR_PASSES", 0)
            alone = adjust_globally(sizes, pairs)
        without.append(error_px(alone.H_world_flat, views))
    assert np.mean(with_prior) < 0.5 * np.mean(without)


@pytest.mark.parametrize("noise_px", [0.0, 0.1])
def test_views_that_are_not_frontal_are_placed_by_their_matches(noise_px: float) -> None:
    rng = np.random.default_rng(11)
    views = grid_views(rng, 2, 2, overlap=0.4, error=0.06)
    adjusted = adjust_globally(dict.fromkeys(views, SIZE), match_all(rng, views, noise_px))
    assert error_px(adjusted.H_world_flat, views) < 0.01 + 2 * noise_px


def test_views_that_differ_by_a_quarter_turn() -> None:
    rng = np.random.default_rng(6)
    views = grid_views(rng, 2, 2)
    turn = np.array([[0.0, -1.0, 1599.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    views[2] = views[2] @ translation(0, -200) @ turn
    adjusted = adjust_globally(dict.fromkeys(views, SIZE), match_all(rng, views))
    assert error_px(adjusted.H_world_flat, views) < 1e-3


def test_residual_is_the_rms_distance() -> None:
    rng = np.random.default_rng(7)
    views = grid_views(rng, 1, 2)
    pair = match(rng, views, 0, 1, noise_px=0.0, offset=(3.0, 4.0))
    assert pair is not None
    there = [Placement(np.linalg.inv(views[1]) @ views[k]) for k in (0, 1)]
    assert residual_px(pair, *there) == pytest.approx(5.0, abs=1e-6)


def test_one_photo_stays_and_photos_that_nothing_joins_are_refused() -> None:
    rng = np.random.default_rng(9)
    assert np.array_equal(adjust_globally({4: SIZE}, []).H_world_flat[4], np.eye(3))
    views = grid_views(rng, 1, 3)
    pair = match(rng, views, 0, 1)
    assert pair is not None
    with pytest.raises(ValueError, match="do not connect"):
        adjust_globally(dict.fromkeys(views, SIZE), [pair])
