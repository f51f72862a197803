"""Normal equations of a mesh: banded, with a border of the few unknowns that every observation may depend on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpbtrf, dtbtrs
from scipy.sparse import csr_array

from services.arrays import Floats, Vector
from services.kernels.library import Equations, Rows, address, find_kernels
from services.sheet.ridged.blocks import SparseRows, stacked


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
        """Step (n + k,), in the unknowns' own order, of (J^T J + diag(damping)) x = -J^T r; None if it is singular.

        With the band's factor L and the border B, the border's own equations are C - Y^T Y, Y = L^-1 B: the border
        needs no way back through L.
        """
        n = self.band.shape[1]
        band = self.band.copy(order="F")
        band[0] += damping[:n]
        factor, singular = dpbtrf(band, lower=1, overwrite_ab=1)
        if singular:
            return None
        right = np.asfortranarray(np.column_stack([self.border, -self.gradient[:n]]))
        below, _ = dtbtrs(factor, right, uplo="L", overwrite_b=1)
        through, own = below[:, :-1], below[:, -1]
        corner = self.corner + np.diag(damping[n:]) - through.T @ through
        try:
            last = np.linalg.solve(corner, -self.gradient[n:] - through.T @ own)
        except np.linalg.LinAlgError:
            return None
        first, _ = dtbtrs(factor, own - through @ last, uplo="L", trans="T")
        step = np.empty(len(self.order))
        step[self.order] = np.concatenate([first.ravel(), last])
        return step if np.isfinite(step).all() else None


def normal_equations(
    rows: Sequence[SparseRows], residuals: Vector, order: NDArray[np.intp], border: int
) -> NormalEquations:
    """Normal equations of weighted `residuals` (M,) with Jacobian `rows` (M, n + k), stacked.

    The last `border` of `order` are k.
    """
    kernels = find_kernels()
    if kernels is None:
        return normal_equations_plain(stacked(rows, len(order)), residuals, order, border)
    residuals = np.ascontiguousarray(residuals, np.float64)
    place = np.empty(len(order), np.intp)
    place[order] = np.arange(len(order))
    n = len(order) - border
    packed = [
        (np.ascontiguousarray(part.columns, np.intp), np.ascontiguousarray(part.entries, np.float64))
        for part in rows
    ]
    if any(columns.shape != entries.shape for columns, entries in packed):
        raise IndexError("each entry of a row has its column")
    parts = [Rows(*columns.shape, address(columns), address(entries)) for columns, entries in packed]
    reach = [kernels.measure_band(part, address(place), len(order), n) for part in parts]
    if min(reach, default=0) < 0 or sum(part.count for part in parts) != len(residuals):
        raise IndexError("rows have columns that there are, and a residual each")
    below = max(reach, default=0)
    band, side, corner = np.zeros((n, below + 1)), np.zeros((n, border)), np.zeros((border, border))
    gradient, begin = np.zeros(len(order)), 0
    sums = Equations(n, border, below, *map(address, (band, side, corner, gradient)))
    for part in parts:
        own = residuals[begin : begin + part.count]
        if not kernels.add_products(part, address(own), address(place), sums):
            raise MemoryError
        begin += part.count
    return NormalEquations(band.T, side, corner, gradient, order)


def normal_equations_plain(
    jacobian: csr_array, residuals: Vector, order: NDArray[np.intp], border: int
) -> NormalEquations:
    """`normal_equations` without a kernel."""
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
