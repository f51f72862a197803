"""Banded normal equations with a border give the steps of dense ones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.arrays import Floats, Vector
from services.sheet.ridged.blocks import SparseRows
from services.sheet.ridged.normal_equations import normal_equations


def problem(
    seed: int, own: int = 30, border: int = 3, rows: int = 200, reach: int = 4
) -> tuple[Floats, Vector, np.ndarray]:
    """A Jacobian (rows, own + border) whose rows couple neighbours and the border, residuals, and an order."""
    rng = np.random.default_rng(seed)
    J = np.zeros((rows, own + border))
    for row in J:
        first = rng.integers(0, own - reach + 1)
        row[first : first + reach] = rng.normal(0, 1, reach)
        row[own + rng.integers(0, border, 2)] = rng.normal(0, 1, 2) if border else 0.0
    # The unknowns' own order is any; the equations' order makes them neighbours again.
    shuffled = rng.permutation(own)
    order = np.concatenate([np.argsort(shuffled), np.arange(own, own + border)])
    return J[:, np.concatenate([shuffled, np.arange(own, own + border)])], rng.normal(0, 1, rows), order


def in_rows(J: Floats) -> list[SparseRows]:
    """The matrix in two parts, with its zeros."""
    columns = np.tile(np.arange(J.shape[1]), (len(J), 1))
    return [SparseRows(columns[part], J[part]) for part in (slice(0, 70), slice(70, None))]


@settings(max_examples=20)
@given(seed=st.integers(0, 1000), damping=st.sampled_from([0.0, 1e-3, 10.0]))
def test_steps_are_those_of_dense_equations(seed: int, damping: float) -> None:
    J, r, order = problem(seed)
    equations = normal_equations(in_rows(J), r, order, 3)
    extra = damping * equations.diagonal
    step = equations.solve(extra)
    own_order = np.empty(len(order))
    own_order[order] = extra
    dense = np.linalg.solve(J.T @ J + np.diag(own_order), -J.T @ r)
    assert step is not None
    assert np.allclose(step, dense, rtol=1e-6, atol=1e-8)


def test_the_band_is_as_narrow_as_the_order_allows() -> None:
    J, r, order = problem(1)
    equations = normal_equations(in_rows(J), r, order, 3)
    assert equations.band.shape == (4, 30)
    assert equations.border.shape == (30, 3)
    assert np.allclose(equations.diagonal, np.diag(J.T @ J)[order])
    # In another order the same step comes from a wider band.
    wide = normal_equations(in_rows(J), r, np.arange(33), 3)
    assert wide.band.shape[0] > 10
    zero = np.zeros(33)
    assert wide.solve(zero) == pytest.approx(equations.solve(zero))


def test_unknowns_that_nothing_holds_are_singular_unless_damped() -> None:
    J, r, order = problem(2)
    J[:, 7] = 0.0
    equations = normal_equations(in_rows(J), r, order, 3)
    assert equations.solve(np.zeros(33)) is None
    step = equations.solve(np.full(33, 1e-6))
    assert step is not None
    assert abs(step[7]) < 1e-9


def test_a_border_that_repeats_an_unknown_is_singular() -> None:
    J, r, order = problem(3)
    J[:, -1] = J[:, -2]
    step = normal_equations(in_rows(J), r, order, 3).solve(np.zeros(33))
    # The last pivot is zero up to rounding: no step, or one that nobody would take.
    assert step is None or np.abs(step).max() > 1e6


def test_a_step_goes_down() -> None:
    J, r, order = problem(4)
    step = normal_equations(in_rows(J), r, order, 3).solve(np.zeros(33))
    assert step is not None
    assert np.sum((r + J @ step) ** 2) < np.sum(r**2)
    assert np.allclose(J.T @ (r + J @ step), 0, atol=1e-9)
