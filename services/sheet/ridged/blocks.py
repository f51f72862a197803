"""Blocks of residuals: values, sparse derivatives, and their loss."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from services.arrays import Floats, Vector
from services.sheet.ridged.parameters import Stage


@dataclass(frozen=True, slots=True, eq=False)
class SparseRows:
    """A sparse matrix with equally many entries in each row: a fit makes dozens of these at every step.

    `columns` (m, k) are the entries' columns, `entries` (m, k) their values. Entries of one column add up.
    """

    columns: NDArray[np.intp]
    entries: Floats

    def __getitem__(self, part: slice) -> "SparseRows":
        """The rows of `part`."""
        return SparseRows(self.columns[part], self.entries[part])

    def scaled(self, factors: Vector | float) -> "SparseRows":
        """Each row times its factor."""
        return SparseRows(self.columns, self.entries * np.reshape(factors, (-1, 1)))

    def __add__(self, other: "SparseRows") -> "SparseRows":
        """The sum of both matrices."""
        return SparseRows(
            np.concatenate([self.columns, other.columns], axis=1),
            np.concatenate([self.entries, other.entries], axis=1),
        )


@dataclass(frozen=True, slots=True, eq=False)
class ResidualBlock:
    """Residuals of one kind: values (m,), Jacobian (m, unknowns), and how many of them share one loss (0: squares)."""

    values: Vector
    jacobian: SparseRows
    group: int


def robust(block: ResidualBlock, stage: Stage) -> tuple[float, Vector]:
    """Cost of a block under its loss (squares, or Cauchy's for each group), and the weight (m,) of every residual."""
    if block.group == 0:
        return 0.5 * float(block.values @ block.values), np.ones(len(block.values))
    square = (block.values.reshape(-1, block.group) ** 2).sum(axis=1)
    s2 = (stage.scale if block.group == 1 else stage.ridge) ** 2
    return 0.5 * s2 * float(np.log1p(square / s2).sum()), np.repeat(1 / (1 + square / s2), block.group)


def single_entries(columns: NDArray[np.intp], values: Vector) -> SparseRows:
    """A matrix with one entry a row."""
    return SparseRows(columns[:, None], values[:, None])


def stacked(parts: Sequence[SparseRows], width: int) -> csr_array:
    """The rows of all `parts`, stacked, as a matrix of `width` columns without its zeros."""
    kept = [part.entries != 0 for part in parts]
    counts = np.concatenate([np.count_nonzero(keep, axis=1) for keep in kept])
    return csr_array(
        (
            np.concatenate([part.entries[keep] for part, keep in zip(parts, kept, strict=True)]),
            np.concatenate([part.columns[keep] for part, keep in zip(parts, kept, strict=True)]),
            np.concatenate([[0], np.cumsum(counts)]),
        ),
        shape=(len(counts), width),
    )
