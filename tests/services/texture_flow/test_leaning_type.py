"""Italics among upright type are turned by their lean; smooth changes of a sheet stay as they are."""

import numpy as np
import pytest

from services.arrays import Vector
from services.texture_flow.field import FlowSamples
from services.texture_flow.leaning_type import FEWEST, upright_type

ROWS, COLUMNS = 12, 6


def samples(change: Vector) -> tuple[FlowSamples, Vector]:
    """Strokes of a page's rows, and their leans: a slight convergence, noise, and `change` (ROWS,) of each row."""
    x, y = (values.ravel().astype(float) for values in np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)))
    noise = np.random.default_rng(3).normal(0, np.deg2rad(0.3), len(x))
    lean = np.deg2rad(0.3) * x + noise + np.repeat(change, COLUMNS)
    return FlowSamples(np.column_stack([x, y]), np.pi / 2 + lean, np.ones(len(x))), lean


@pytest.mark.parametrize("rows", [slice(9, 12), slice(0, 3), slice(5, 12)])
def test_leaning_rows_stand_upright(rows: slice) -> None:
    change = np.zeros(ROWS)
    change[rows] = np.deg2rad(12.0)
    found, lean = samples(change)
    upright, _ = samples(np.zeros(ROWS))
    np.testing.assert_allclose(upright_type(found, lean).angles, upright.angles, atol=np.deg2rad(0.7))


@pytest.mark.parametrize("change", [np.zeros(ROWS), np.linspace(0, np.deg2rad(25), ROWS)])
def test_what_changes_smoothly_is_the_sheet(change: Vector) -> None:
    found, lean = samples(change)
    assert upright_type(found, lean) is found


def test_a_few_samples_aslant_are_no_type() -> None:
    found, lean = samples(np.zeros(ROWS))
    lean[: FEWEST - 1] += np.deg2rad(12.0)
    assert upright_type(found, lean) is found
