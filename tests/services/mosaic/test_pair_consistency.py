"""Ways through the graph of pairs, and pairs that do not fit it."""

from dataclasses import replace

import numpy as np

from services.geometry.homographies import translation
from services.mosaic.pair_consistency import drop_contradictions, find_ways
from services.mosaic.pair_registration import PairRegistration

HEIGHTS = dict.fromkeys(range(5), 20.0)
PLACES = {0: (0.0, 0.0), 1: (500.0, 10.0), 2: (490.0, 600.0), 3: (-10.0, 590.0), 4: (1000.0, 600.0)}


def pair(a: int, b: int, strength: float = 1.0, wrong: tuple[float, float] = (0, 0)) -> PairRegistration:
    """Views that only differ by shifts; `wrong` is added to what the pair says."""
    H = translation(*(np.subtract(PLACES[b], PLACES[a]) + wrong))
    points_b = np.random.default_rng(a + 10 * b).uniform(0, 400, (30, 2))
    return PairRegistration(
        a, b, H, points_b + H[:2, 2], points_b, np.full(30, strength), 100, 30, 10, agreement=1.0
    )


def graph(*pairs: PairRegistration) -> dict[tuple[int, int], PairRegistration]:
    return {(one.a, one.b): one for one in pairs}


def test_ways_chain_the_homographies_over_few_photos() -> None:
    ways = find_ways(graph(pair(0, 1), pair(1, 2), pair(2, 4), pair(0, 3), pair(2, 3)), range(5))
    between, H = ways[0, 4]
    assert between == 2
    np.testing.assert_allclose(H, translation(*PLACES[4]), atol=1e-9)
    assert ways[0, 1][0] == 0
    np.testing.assert_allclose(ways[4, 0][1] @ H, np.eye(3), atol=1e-9)


def test_no_way_between_parts() -> None:
    assert set(find_ways(graph(pair(0, 1), pair(2, 4)), range(5))) == {(0, 1), (1, 0), (2, 4), (4, 2)}


def test_pairs_that_agree_all_stay() -> None:
    pairs = graph(pair(0, 1), pair(1, 2), pair(2, 3), pair(0, 3, wrong=(15, -10)))
    assert set(drop_contradictions(pairs, range(5), HEIGHTS, 4.0)) == set(pairs)


def test_weak_pair_that_contradicts_a_loop_is_dropped() -> None:
    pairs = graph(pair(0, 1), pair(1, 2), pair(2, 3), pair(0, 3, strength=0.4, wrong=(0, 300)))
    assert set(drop_contradictions(pairs, range(5), HEIGHTS, 4.0)) == {(0, 1), (1, 2), (2, 3)}


def test_strength_decides_not_the_order() -> None:
    false = pair(0, 1, strength=0.3, wrong=(400, 0))
    pairs = graph(false, pair(1, 2), pair(0, 2))
    for order in ([0, 1, 2], [2, 1, 0], [1, 0, 2]):
        assert set(drop_contradictions(pairs, order, HEIGHTS, 4.0)) == {(1, 2), (0, 2)}
    disagreeing = replace(pairs[0, 2], agreement=0.1)
    assert (0, 2) not in drop_contradictions({**pairs, (0, 2): disagreeing}, [0, 1, 2], HEIGHTS, 4.0)
