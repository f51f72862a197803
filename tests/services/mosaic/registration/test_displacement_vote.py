"""The vote on matches that are known: nine or nineteen of twenty are false."""

import numpy as np
import pytest

from services.kernels.library import find_kernels
from services.mosaic.registration.displacement_vote import (
    GROUPS,
    outstanding_bin,
    outstanding_bin_plain,
    vote_displacements,
)
from services.mosaic.registration.features import FeatureMatches

DIAGONAL = 1000.0
SPAN = np.array([800.0, 600.0])


def matches(
    rng: np.random.Generator,
    true: int,
    false: int,
    scale: float,
    shift: tuple[float, float],
    noise_px: float = 1.0,
) -> FeatureMatches:
    """True ones first: b's points p lie at scale p + shift in a. Sizes are told to 10 %."""
    points_b = rng.uniform(0, 1, (true + false, 2)) * SPAN
    points_a = scale * points_b + shift + rng.normal(0, noise_px, points_b.shape)
    points_a[true:] = rng.uniform(0, 1, (false, 2)) * SPAN
    sizes_b = rng.uniform(4, 12, true + false)
    sizes_a = sizes_b * scale * np.exp(rng.normal(0, 0.1, true + false))
    sizes_a[true:] = rng.uniform(4, 12, false)
    return FeatureMatches(points_a, points_b, sizes_a, sizes_b)


@pytest.mark.parametrize("scale", [0.6, 0.85, 1.0, 1.3, 1.7])
@pytest.mark.parametrize(("true", "false"), [(60, 540), (40, 760)])
def test_true_scale_and_displacement_come_first(scale: float, true: int, false: int) -> None:
    shift = (310.0, -140.0)
    given = matches(np.random.default_rng(3), true, false, scale, shift)
    first, second = vote_displacements(given, DIAGONAL)[:2]
    assert abs(np.log(first.scale / scale)) < 0.04
    middle = np.median(given.points_b[:true], axis=0)
    np.testing.assert_allclose(
        first.scale * middle + first.displacement, scale * middle + np.array(shift), atol=DIAGONAL / 90
    )
    assert np.mean(first.members < true) > 0.8
    assert first.votes > 0.6 * true
    assert second.votes < 0.5 * first.votes


def test_groups_do_not_share_members_and_lie_apart() -> None:
    rng = np.random.default_rng(5)
    one, two = matches(rng, 50, 300, 1.0, (200, 100)), matches(rng, 40, 0, 1.2, (-300, 50))
    both = FeatureMatches(
        *(
            np.concatenate([getattr(one, name), getattr(two, name)])
            for name in ("points_a", "points_b", "sizes_a", "sizes_b")
        )
    )
    groups = vote_displacements(both, DIAGONAL)
    members = np.concatenate([group.members for group in groups])
    assert len(np.unique(members)) == len(members)
    assert abs(np.log(groups[0].scale / 1.0)) < 0.04
    assert abs(np.log(groups[1].scale / 1.2)) < 0.04


def test_small_group_beyond_the_crowd_is_seen() -> None:
    # 20 of 1020, displaced by most of the view: fewer than by chance agree where the views overlap wholly.
    rng = np.random.default_rng(8)
    given = matches(rng, 0, 1000, 1.0, (0, 0))
    edge = rng.uniform([0, 0], [60, 600], (20, 2))
    points_a = np.concatenate([given.points_a, edge + np.array([735, 0])])
    points_b = np.concatenate([given.points_b, edge])
    sizes = rng.uniform(4, 12, 20)
    small = FeatureMatches(
        points_a,
        points_b,
        np.concatenate([given.sizes_a, sizes]),
        np.concatenate([given.sizes_b, sizes]),
    )
    first = vote_displacements(small, DIAGONAL)[0]
    assert np.mean(first.members >= 1000) > 0.8


def test_chance_stays_chance() -> None:
    groups = vote_displacements(matches(np.random.default_rng(1), 0, 800, 1.0, (0, 0)), DIAGONAL)
    assert len(groups) > 1
    assert max(group.votes for group in groups) < 20
    assert len(groups) <= GROUPS


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_matches_make_no_group(count: int) -> None:
    assert vote_displacements(matches(np.random.default_rng(1), count, 0, 1.0, (0, 0)), DIAGONAL) == ()


def test_order_of_matches_plays_no_part() -> None:
    given = matches(np.random.default_rng(4), 50, 500, 1.1, (100, 50))
    other = np.random.default_rng(9).permutation(550)
    shuffled = FeatureMatches(
        given.points_a[other], given.points_b[other], given.sizes_a[other], given.sizes_b[other]
    )
    for one, two in zip(vote_displacements(given, 1000), vote_displacements(shuffled, 1000), strict=True):
        assert one.scale == two.scale
        assert set(one.members) == set(other[two.members])


@pytest.mark.skipif(find_kernels() is None, reason="needs kernels, which a C compiler makes")
@pytest.mark.parametrize("scales", [1, 2, 41])
@pytest.mark.parametrize("count", [1, 40, 700])
@pytest.mark.parametrize("reach", [2.0, 25.0, 80.0])
def test_the_kernel_finds_the_same_bin(scales: int, count: int, reach: float) -> None:
    rng = np.random.default_rng([scales, count, round(reach)])
    for share in (0.02, 0.1, 0.5):
        bins = rng.normal(0, reach, (scales, count, 2))
        voting = rng.random((scales, count)) < share
        voting[rng.integers(scales), rng.integers(count)] = True
        row, middle = outstanding_bin(bins, voting)
        expected_row, expected = outstanding_bin_plain(bins, voting)
        assert row == expected_row
        np.testing.assert_array_equal(middle, expected)


def test_what_cannot_vote_is_refused() -> None:
    with pytest.raises(ValueError, match="vote"):
        outstanding_bin(np.zeros((2, 3, 2)), np.zeros((2, 3), bool))
    with pytest.raises(ValueError, match="vote"):
        outstanding_bin(np.zeros((2, 3, 2)), np.ones((2, 4), bool))
    for beyond in (np.nan, np.inf, 1e30):
        with pytest.raises(ValueError, match="vote"):
            outstanding_bin(np.full((2, 3, 2), beyond), np.ones((2, 3), bool))
