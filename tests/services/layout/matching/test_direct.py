from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.layout.simulated_cost_tables import (
    EASY,
    HARD,
    HOPELESS,
    TYPICAL,
    Hardness,
    simulated_tables,
    strong_tables,
)
from services.layout.matching import MatchingParameters, match_directly
from services.layout.matching.cost_tables import CostTables
from tests.services.layout.matching.brute_force import least_cost

PARAMETERS = MatchingParameters(max_ms=10_000.0)
SIZES = [(1, 1), (1, 4), (2, 2), (4, 1), (3, 3), (5, 4), (6, 3), (9, 2)]


@pytest.mark.pipeline
@settings(max_examples=250, deadline=None)
@given(
    st.integers(0, 2**32),
    st.sampled_from(SIZES),
    st.sampled_from([0.0, 0.3, 1.0, 3.0, 30.0]),
    st.sampled_from([0.3, 3.0]),
)
def test_the_least_cost_is_found_and_proved(
    seed: int, size: tuple[int, int], scale: float, counts: float
) -> None:
    tables = strong_tables(*size, scale, np.random.default_rng(seed), counts)
    found = match_directly(tables, PARAMETERS)
    assert found.optimal
    assert found.gap == 0.0
    assert found.cost == tables.cost(found.labels)
    assert found.cost == pytest.approx(least_cost(tables), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("counts", [0.3, 3.0, 30.0])
@pytest.mark.parametrize("scale", [0.3, 3.0, 30.0])
def test_no_proof_is_false(scale: float, counts: float) -> None:
    """Many small tables, as a bound that double counts is wrong only now and then."""
    for seed in range(60):
        size = ((3, 3), (5, 4), (6, 3))[seed % 3]
        tables = strong_tables(*size, scale, np.random.default_rng(seed), counts)
        assert match_directly(tables, PARAMETERS).cost == pytest.approx(
            least_cost(tables), rel=1e-9, abs=1e-9
        )


@settings(max_examples=120, deadline=None)
@given(
    st.integers(0, 2**32),
    st.sampled_from(SIZES),
    st.sampled_from([0.3, 3.0, 1e6]),
    st.integers(0, 3),
    st.integers(0, 4),
)
def test_the_bound_holds_under_every_budget(
    seed: int, size: tuple[int, int], scale: float, max_sweeps: int, max_nodes: int
) -> None:
    tables = strong_tables(*size, scale, np.random.default_rng(seed))
    found = match_directly(tables, MatchingParameters(max_nodes, max_sweeps, max_ms=10_000.0))
    least = least_cost(tables)
    rounding = 1e-9 * (1.0 + abs(least))
    assert found.lower_bound <= least + rounding
    assert least <= found.cost + rounding
    assert found.explored <= max_nodes
    assert found.optimal == (found.gap == 0.0)
    if found.optimal:
        assert found.cost == pytest.approx(least, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    "hardness", [EASY, TYPICAL, HARD, HOPELESS], ids=["easy", "typical", "hard", "hopeless"]
)
def test_pages_small_enough_to_try_everything(hardness: Hardness) -> None:
    for seed in range(8):
        tables, _ = simulated_tables(6, 4, hardness, np.random.default_rng(seed))
        found = match_directly(tables, PARAMETERS)
        assert found.optimal
        assert found.cost == pytest.approx(least_cost(tables), rel=1e-9, abs=1e-9)


def test_typical_pages_of_fifteen_zones_are_proved() -> None:
    proved = [
        match_directly(simulated_tables(15, 10, TYPICAL, np.random.default_rng(seed))[0], PARAMETERS).optimal
        for seed in range(20)
    ]
    assert sum(proved) >= 18


def test_a_large_page_finds_its_labels_and_says_its_gap() -> None:
    tables, truth = simulated_tables(60, 15, EASY, np.random.default_rng(5))
    found = match_directly(tables, PARAMETERS)
    assert found.cost <= tables.cost(truth)
    assert (found.labels == truth).mean() > 0.85
    assert found.optimal or found.gap > 0.0


@pytest.mark.parametrize("seed", range(6))
def test_order_of_zones_pairs_and_labels_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tables, _ = simulated_tables(10, 5, HARD, rng)
    zones, labels = rng.permutation(tables.zones), rng.permutation(tables.labels)
    place = np.argsort(zones)
    pairs = place[tables.pairs]
    turned = pairs[:, 0] > pairs[:, 1]
    edge = tables.edge[:, labels][:, :, labels]
    edge[turned] = edge[turned].transpose(0, 2, 1)
    order = rng.permutation(len(pairs))
    other = CostTables(
        tables.node[zones][:, labels], np.sort(pairs, 1)[order], edge[order], tables.count[labels]
    )
    a, b = match_directly(tables, PARAMETERS), match_directly(other, PARAMETERS)
    assert a.optimal
    assert b.optimal
    assert b.cost == pytest.approx(a.cost, rel=1e-9)
    assert tables.cost(labels[b.labels][place]) == pytest.approx(a.cost, rel=1e-9)


def test_counts_alone_decide_how_many() -> None:
    count = np.zeros((3, 6))
    count[1] = [4.0, 0.0, 3.0, 6.0, 9.0, 12.0]
    count[2] = [0.0, 5.0, 1.0, -2.0, 5.0, 6.0]
    node = np.tile([0.5, 0.0, 0.0], (5, 1))
    tables = CostTables(node, np.zeros((0, 2), np.intp), np.zeros((0, 3, 3)), count)
    found = match_directly(tables, PARAMETERS)
    assert found.optimal
    assert np.bincount(found.labels, minlength=3).tolist() == [1, 1, 3]


def test_the_answer_is_the_same_every_time() -> None:
    tables, _ = simulated_tables(30, 8, HARD, np.random.default_rng(2))
    a, b = match_directly(tables, PARAMETERS), match_directly(tables, PARAMETERS)
    assert np.array_equal(a.labels, b.labels)
    assert (a.cost, a.lower_bound, a.explored) == (b.cost, b.lower_bound, b.explored)


def test_no_zones_leave_the_cost_of_what_is_missing() -> None:
    tables, _ = simulated_tables(0, 4, TYPICAL, np.random.default_rng(0))
    found = match_directly(tables, PARAMETERS)
    assert found.optimal
    assert found.labels.shape == (0,)
    assert found.cost == tables.count.sum()


def test_one_zone_and_one_label() -> None:
    tables, _ = simulated_tables(1, 4, TYPICAL, np.random.default_rng(0))
    found = match_directly(tables, PARAMETERS)
    assert found.optimal
    assert found.cost == pytest.approx(least_cost(tables))


def test_time_that_is_over_still_answers() -> None:
    tables, _ = simulated_tables(25, 8, HARD, np.random.default_rng(1))
    hurried = match_directly(tables, replace(PARAMETERS, max_ms=0.0))
    full = match_directly(tables, PARAMETERS)
    assert hurried.lower_bound <= full.cost <= hurried.cost
    assert hurried.explored == 0


def test_five_hundred_zones() -> None:
    tables, truth = simulated_tables(500, 8, TYPICAL, np.random.default_rng(1), density=0.06)
    found = match_directly(tables, MatchingParameters())
    assert found.lower_bound <= found.cost <= tables.cost(truth)


@pytest.mark.pipeline
def test_tables_too_large_to_copy_have_the_plain_bound() -> None:
    tables, truth = simulated_tables(230, 15, EASY, np.random.default_rng(1))
    assert tables.edge.size > 6_000_000
    found = match_directly(tables, MatchingParameters())
    assert not found.optimal
    assert found.lower_bound < found.cost <= tables.cost(truth)
