"""Normal equations of a mesh: banded, with a border of the few unknowns that every observation may depend on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.sparse import csr_array

from services.arrays import Floats, Vector


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations:
    """J^T J x = -J^T r with the unknowns in an order that keeps the matrix in a narrow band.

    `band` (bandwidth + 1, n) is the lower band of the first n unknowns in scipy's form, `border` (n, k) couples them
    with the last k, `corner` (k, k) these among themselves; `gradient` (n + k,) is J^T r in that order, and `order`
    (n + k,) are the numbers of the unknowns.
    """

    band: Floats
    border: Floats
    corner: Floats
    gradient: Vector
    order: NDArray[np.intp]

    @property
    def diagonal(self) -> Vector:
        """Diagonal (n + k,) of J^T J."""
        return np.concatenate([self.band[0], np.diag(self.corner)])

    def solve(self, damping: Vector) -> Vector | None:
        """Step (n + k,), in the unknowns' own order, of (J^T J + diag(damping)) x = -J^T r; None if it is singular."""
        n = self.band.shape[1]
        band = self.band.copy()
        band[0] += damping[:n]
        right = np.column_stack([self.border, -self.gradient[:n]])
        try:
            solved = cho_solve_banded((cholesky_banded(band, lower=True, check_finite=False), True), right)
            through, own = solved[:, :-1], solved[:, -1]
            corner = self.corner + np.diag(damping[n:]) - self.border.T @ through
            last = np.linalg.solve(corner, -self.gradient[n:] - self.border.T @ own)
        except (LinAlgError, np.linalg.LinAlgError):
            return None
        step = np.empty(len(self.order))
        step[self.order] = np.concatenate([own - through @ last, last])
        return step if np.isfinite(step).all() else None


def normal_equations(
    jacobian: csr_array, residuals: Vector, order: NDArray[np.intp], border: int
) -> NormalEquations:
    """Normal equations of weighted `residuals` (M,) with `jacobian` (M, n + k); the last `border` of `order` are k."""
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    n = len(order) - border
    ordered = csr_array((jacobian.data, place[jacobian.indices], jacobian.indptr), shape=jacobian.shape)
    square = ordered.T @ ordered  # symmetric: rows or columns may come first
    row = np.repeat(np.arange(len(order), dtype=np.int32), np.diff(square.indptr))
    lower = np.flatnonzero(row >= square.indices)
    row, column, values = row[lower], square.indices[lower], square.data[lower]
    inside, last = row < n, column >= n
    below = row[inside] - column[inside]
    band = np.zeros((int(below.max(initial=0)) + 1, n))
    band[below, column[inside]] = values[inside]
    edge = ~(inside | last)
    side = np.zeros((n, border))
    side[column[edge], row[edge] - n] = values[edge]
    corner = np.zeros((border, border))
    corner[row[last] - n, column[last] - n] = corner[column[last] - n, row[last] - n] = values[last]
    return NormalEquations(band, side, corner, ordered.T @ residuals, order)
