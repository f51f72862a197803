"""Blocks of residuals: values, sparse derivatives, and the loss that they are charged by."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from services.arrays import Vector
from services.sheet.ridged.parameters import Stage


@dataclass(frozen=True, slots=True, eq=False)
class ResidualBlock:
    """Residuals of one kind: values (m,), Jacobian (m, unknowns), and how many of them share one loss (0: squares)."""

    values: Vector
    jacobian: csr_array
    group: int


def robust(block: ResidualBlock, stage: Stage) -> tuple[float, Vector]:
    """Cost of a block under its loss (squares, or Cauchy's for each group), and the weight (m,) of every residual."""
    if block.group == 0:
        return 0.5 * float(block.values @ block.values), np.ones(len(block.values))
    square = (block.values.reshape(-1, block.group) ** 2).sum(axis=1)
    s2 = (stage.scale if block.group == 1 else stage.ridge) ** 2
    return 0.5 * s2 * float(np.log1p(square / s2).sum()), np.repeat(1 / (1 + square / s2), block.group)


def scaled_rows(matrix: csr_array, factors: Vector) -> csr_array:
    """`matrix` with every row times its factor."""
    scaled = csr_array(matrix, copy=True)
    scaled.data *= np.repeat(factors, np.diff(scaled.indptr))
    return scaled


def single_entries(columns: NDArray[np.intp], values: Vector, width: int) -> csr_array:
    """A matrix with one entry a row."""
    return csr_array((values, columns, np.arange(len(columns) + 1)), shape=(len(columns), width))
