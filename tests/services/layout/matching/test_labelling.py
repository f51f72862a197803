import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.layout.simulated_cost_tables import HARD, TYPICAL, simulated_tables, strong_tables
from services.layout.matching import backbone_of, conditional_costs
from services.layout.matching.labelling import Labelling, Neighbours
from services.layout.matching.local_search import exchange, improve, relabel_together
from tests.services.layout.matching.brute_force import all_costs


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([(1, 1), (1, 3), (7, 4), (12, 3)]))
def test_conditional_costs_are_those_of_the_changed_labellings(seed: int, size: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    tables = strong_tables(*size, 2.0, rng)
    labels = rng.integers(0, size[1], size[0])
    found = conditional_costs(tables, labels)
    changed = np.repeat(labels[None], size[0] * size[1], 0)
    zones, names = np.divmod(np.arange(len(changed)), size[1])
    changed[np.arange(len(changed)), zones] = names
    np.testing.assert_allclose(found.ravel(), all_costs(tables, changed), atol=1e-9)


def test_the_field_follows_changes() -> None:
    rng = np.random.default_rng(3)
    tables = strong_tables(9, 4, 2.0, rng)
    neighbours = Neighbours(tables)
    state = Labelling(tables, neighbours, rng.integers(0, 4, 9))
    for _ in range(30):
        state.change(int(rng.integers(9)), int(rng.integers(4)))
    anew = Labelling(tables, neighbours, state.labels)
    np.testing.assert_allclose(state.field, anew.field, atol=1e-9)
    assert np.array_equal(state.counts, anew.counts)


@pytest.mark.parametrize("move", ["exchange", "relabel_together"])
def test_moves_of_many_zones_gain_what_they_are_chosen_for(move: str) -> None:
    moved = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        tables = strong_tables(8, 4, 2.0, rng)
        state = Labelling(tables, Neighbours(tables), rng.integers(0, 4, 8))
        before = tables.cost(state.labels)
        done = exchange(state, 1e-9) if move == "exchange" else relabel_together(tables, state, 1e-9)
        after = tables.cost(state.labels)
        assert (after < before) == done
        moved += done
    assert moved > 10


def test_relabelling_a_group_is_valued_exactly() -> None:
    """With two labels all of one are relabelled: the gain is the difference of two costs."""
    for seed in range(20):
        tables = strong_tables(6, 2, 2.0, np.random.default_rng(seed))
        zeros, ones = np.zeros(6, np.intp), np.ones(6, np.intp)
        state = Labelling(tables, Neighbours(tables), zeros)
        assert relabel_together(tables, state, 0.0) == (tables.cost(ones) < tables.cost(zeros))


def test_no_single_change_improves_what_local_search_found() -> None:
    for seed in range(5):
        tables, _ = simulated_tables(20, 6, HARD, np.random.default_rng(seed))
        labels, cost = improve(tables, Neighbours(tables), tables.node.argmin(1))
        assert cost == tables.cost(labels) <= tables.cost(tables.node.argmin(1))
        assert conditional_costs(tables, labels).min() >= cost - 1e-6


def test_the_backbone_is_the_surest_zone_of_each_label() -> None:
    tables, truth = simulated_tables(25, 5, TYPICAL, np.random.default_rng(7))
    backbone = backbone_of(tables, truth)
    assert set(backbone) == set(truth[truth > 0].tolist())
    field = Labelling(tables, Neighbours(tables), truth).field
    for label, zone in backbone.items():
        assert truth[zone] == label
        assert field[zone, label] == field[truth == label, label].min()


def test_nothing_has_neither_costs_nor_backbone() -> None:
    tables, truth = simulated_tables(0, 3, TYPICAL, np.random.default_rng(0))
    assert conditional_costs(tables, truth).shape == (0, 4)
    assert backbone_of(tables, truth) == {}
