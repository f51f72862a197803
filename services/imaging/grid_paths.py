"""Best paths down the rows of a grid, by dynamic programming, for many grids at once."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from services.arrays import Floats, Vector
from services.kernels.library import address, find_kernels

SHIFT_COST = 0.02
"""Of a path for a step of one column from row to row, in full edges: edges of paper are straight or bend gently."""


def accumulate_scores(score: Floats, max_shift: int, shift_cost: float) -> Floats:
    """Best sums (..., N, M) of `score` (..., N, M) over paths from the first row to every sample.

    From row to row the column changes by `max_shift` at most, which costs `shift_cost` a column. Samples with a score
    of -inf are never used.
    """
    kernels = find_kernels()
    if kernels is None:
        return accumulate_scores_plain(score, max_shift, shift_cost)
    score, costs = np.ascontiguousarray(score, np.float64), _costs(max_shift, shift_cost)
    best, (rows, columns) = np.empty(score.shape), score.shape[-2:]
    grids = score.size // max(rows * columns, 1)
    sizes = (grids, rows, columns, max_shift)
    if not kernels.accumulate_scores(address(score), address(best), *sizes, address(costs)):
        raise MemoryError
    return best


def accumulate_scores_plain(score: Floats, max_shift: int, shift_cost: float) -> Floats:
    """`accumulate_scores` without a kernel, to the last bit.

    All grids go through the rows together: a row of one grid is too short for numpy.
    """
    columns = score.shape[-1]
    cost = _costs(max_shift, shift_cost)
    padded = np.full((*score.shape[:-2], columns + 2 * max_shift), -np.inf)
    inner = padded[..., max_shift : max_shift + columns]
    # Shifts first: the greatest of them are taken over all grids in one run through memory.
    windows = np.moveaxis(sliding_window_view(padded, columns, axis=-1), -2, 0)
    costs = cost.reshape(-1, *(1,) * inner.ndim)
    work, most = np.empty(windows.shape), np.empty(inner.shape)
    best = np.empty(score.shape)
    inner[...] = best[..., 0, :] = score[..., 0, :]
    rows = zip(np.moveaxis(score, -2, 0)[1:], np.moveaxis(best, -2, 0)[1:], strict=True)
    for gained, reached in rows:
        np.subtract(windows, costs, out=work)
        np.maximum.reduce(work, axis=0, out=most)
        np.add(most, gained, out=inner)
        reached[...] = inner
    return best


def accumulate_to_row(score: Floats, row: int, max_shift: int, shift_cost: float) -> tuple[Floats, Floats]:
    """Best sums (G, `row` + 1, M) of `score` (G, N, M) from the first row down to `row`, and (G, N - `row`, M) from the
    last one up to it; the last of each is that row.

    Both ways go through the rows together, which takes half as many steps.
    """
    grids, rows, columns = score.shape
    longer = max(row + 1, rows - row)
    both = np.zeros((2, grids, longer, columns))
    # Rows of zeros before the first one change no sum.
    both[0, :, longer - row - 1 :] = score[:, : row + 1]
    both[1, :, longer - rows + row :] = score[:, row:][:, ::-1]
    best = accumulate_scores(both.reshape(2 * grids, longer, columns), max_shift, shift_cost)
    return best[:grids, longer - row - 1 :], best[grids:, longer - rows + row :]


def trace_back(
    best: Floats, grids: NDArray[np.intp], ends: NDArray[np.intp], max_shift: int, shift_cost: float
) -> NDArray[np.intp]:
    """Columns (K, N) of the paths that end at column `ends` (K,) of the last row of the grids number `grids` (K,).

    `best` (G, N, M) is what `accumulate_scores` returned for the same `max_shift` and `shift_cost`.
    """
    kernels = find_kernels()
    if kernels is None:
        return trace_back_plain(best, grids, ends, max_shift, shift_cost)
    best, costs = np.ascontiguousarray(best, np.float64), _costs(max_shift, shift_cost)
    grids, ends = np.ascontiguousarray(grids, np.intp), np.ascontiguousarray(ends, np.intp)
    rows, columns = best.shape[1:]
    if not rows or len(ends) != len(grids):
        raise IndexError("paths end in the last row of a grid")
    if len(ends) and not (
        0 <= grids.min() <= grids.max() < len(best) and 0 <= ends.min() <= ends.max() < columns
    ):
        raise IndexError("paths end within grids that there are")
    paths = np.empty((len(ends), rows), np.intp)
    places = address(grids), address(ends), len(ends), address(paths)
    kernels.trace_back(address(best), rows, columns, max_shift, address(costs), *places)
    return paths


def trace_back_plain(
    best: Floats, grids: NDArray[np.intp], ends: NDArray[np.intp], max_shift: int, shift_cost: float
) -> NDArray[np.intp]:
    """`trace_back` without a kernel: the same paths."""
    cost = _costs(max_shift, shift_cost)
    grid_count, rows, columns = best.shape
    padded = np.full((grid_count, rows, columns + 2 * max_shift), -np.inf)
    padded[..., max_shift : max_shift + columns] = best
    values, width = padded.ravel(), columns + 2 * max_shift
    whence = grids[:, None] * (rows * width) + np.arange(2 * max_shift + 1) + (rows - 1) * width
    at, together = np.array(ends, np.intp), np.empty((rows, len(ends)), np.intp)
    together[-1] = at
    index, near, shift = np.empty_like(whence), np.empty(whence.shape), np.empty_like(at)
    for row in range(rows - 2, -1, -1):
        whence -= width
        np.add(whence, at[:, None], out=index)
        # All indices are valid: clipping only spares a copy.
        values.take(index, out=near, mode="clip")
        np.subtract(near, cost, out=near)
        near.argmax(axis=1, out=shift)
        at += shift
        at -= max_shift
        # Where no path leads to, all is -inf and the first column is taken.
        together[row] = np.maximum(at, 0, out=at)
    return np.ascontiguousarray(together.T)


def _costs(max_shift: int, shift_cost: float) -> Vector:
    """Of shifts (2 `max_shift` + 1,) from row to row."""
    return shift_cost * np.abs(np.arange(-max_shift, max_shift + 1))
