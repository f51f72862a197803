"""The shifts that print asks for are those that a view lacks, beyond shifts, turns and scales."""

import numpy as np
import pytest

from services.arrays import Points
from services.rectify.view.correction import SmoothField, asked_percent, demand

FIELD = SmoothField(800, 1100)


def places(count: int = 400) -> Points:
    return np.random.default_rng(3).uniform([0, 0], [800, 1100], (count, 2))


def asked_for(shifts: Points, at: Points, deviation: float = 1e-4) -> float:
    """Percent that are asked for where places `at` (N, 2) shall be moved by `shifts` (N, 2), in widths."""
    terms = FIELD.values(at)
    wanted = [
        demand(shifts[:, 0] - shifts[0, 0], deviation, x=terms - terms[0]),
        demand(shifts[:, 1] - shifts[0, 1], deviation, y=terms - terms[0]),
    ]
    return asked_percent(FIELD, wanted)


def test_a_bend_is_asked_for_as_it_is() -> None:
    at = places()
    across = at[:, 0] / 800 - 0.5
    bend = 0.02 * np.column_stack([0 * across, across**2])
    true = 100 * 0.02 * float(np.std(across**2))
    assert 0.9 * true < asked_for(bend, at) < 1.1 * true


def test_a_similarity_asks_for_nothing() -> None:
    at = places() / 800
    turn, scale = 0.01, 0.004
    shifts = np.column_stack([scale * at[:, 0] - turn * at[:, 1], scale * at[:, 1] + turn * at[:, 0]])
    assert asked_for(shifts, places()) < 0.02


def test_nothing_seen_asks_for_nothing() -> None:
    at = places(30)
    assert asked_for(np.zeros((30, 2)), at) == pytest.approx(0.0, abs=1e-9)


def test_one_part_that_is_wrong_moves_little() -> None:
    at = places()
    shifts = np.zeros((len(at), 2))
    shifts[-20:, 1] = 0.3
    assert asked_for(shifts, at, deviation=1e-3) < 0.1


@pytest.mark.parametrize("axis", [0, 1])
def test_slopes_are_the_derivatives_of_the_terms(axis: int) -> None:
    at, step = places(50) * 0.9 + [40, 55], np.eye(2)[axis] * 0.01
    numeric = (FIELD.values(at + step) - FIELD.values(at - step)) / (0.02 / FIELD.width)
    assert FIELD.slopes(at)[axis] == pytest.approx(numeric, abs=1e-5)
