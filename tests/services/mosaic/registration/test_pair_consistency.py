"""Ways through the graph of pairs, and pairs that do not fit it."""

from dataclasses import replace

import numpy as np

from services.geometry.homographies import translation
from services.mosaic.registration.pair_consistency import drop_contradictions, drop_lonely_lines, find_ways
from services.mosaic.registration.pair_registration import PairRegistration

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


def line(a: int, b: int, start: float, end: float, y: float = 390.0, wrong: float = 0.0) -> PairRegistration:
    """A pair that a piece of one line of print holds together, from `start` to `end` in view b."""
    whole = pair(a, b, wrong=(wrong, 0.0))
    x = np.linspace(start, end, 30)
    points_b = np.stack([x, np.full(30, y) + 3 * np.sin(x)], axis=1)
    return replace(whole, points_a=points_b + whole.H_a_b[:2, 2], points_b=points_b)


def joined(
    pairs: dict[tuple[int, int], PairRegistration], contradicted: bool = False
) -> set[tuple[int, int]]:
    return set(drop_lonely_lines(pairs, range(5), HEIGHTS, 1.5, 15.0, lambda *_: contradicted))


def test_a_piece_of_a_line_joins_parts_that_agree_where_they_overlap() -> None:
    pairs = graph(pair(0, 1), line(1, 2, 0, 400), pair(2, 3))
    assert joined(pairs) == {(0, 1), (1, 2), (2, 3)}
    assert joined(pairs, contradicted=True) == {(0, 1), (2, 3)}


def test_a_word_or_two_join_nothing() -> None:
    assert joined(graph(pair(0, 1), line(1, 2, 0, 250), pair(2, 3))) == {(0, 1), (2, 3)}


def test_lines_join_parts_whatever_else() -> None:
    pairs = graph(pair(0, 1), pair(1, 2), pair(2, 3))
    assert joined(pairs, contradicted=True) == set(pairs)


def test_within_a_part_a_phrase_may_stay() -> None:
    pairs = graph(pair(0, 1), pair(1, 2), line(0, 2, 0, 100))
    assert joined(pairs, contradicted=True) == set(pairs)
