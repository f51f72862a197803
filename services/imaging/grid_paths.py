"""Best paths down the rows of a grid, by dynamic programming, for many grids at once."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from services.arrays import Floats


def accumulate_scores(score: Floats, max_shift: int, shift_cost: float) -> Floats:
    """Best sums (..., N, M) of `score` (..., N, M) over paths from the first row to every sample.

    From row to row the column changes by `max_shift` at most, which costs `shift_cost` a column. Samples with a score
    of -inf are never used. All grids go through the rows together: a row of one grid is too short for numpy.
    """
    columns = score.shape[-1]
    cost = shift_cost * np.abs(np.arange(-max_shift, max_shift + 1))[:, None]
    padded = np.full((*score.shape[:-2], columns + 2 * max_shift), -np.inf)
    inner = padded[..., max_shift : max_shift + columns]
    windows = sliding_window_view(padded, columns, axis=-1)
    work = np.empty(windows.shape)
    best = np.empty(score.shape)
    inner[...] = best[..., 0, :] = score[..., 0, :]
    for row in range(1, score.shape[-2]):
        np.subtract(windows, cost, out=work)
        np.add(np.maximum.reduce(work, axis=-2), score[..., row, :], out=inner)
        best[..., row, :] = inner
    return best


def trace_back(
    best: Floats, grids: NDArray[np.intp], ends: NDArray[np.intp], max_shift: int, shift_cost: float
) -> NDArray[np.intp]:
    """Columns (K, N) of the paths that end at column `ends` (K,) of the last row of the grids number `grids` (K,).

    `best` (G, N, M) is what `accumulate_scores` returned for the same `max_shift` and `shift_cost`.
    """
    shifts = np.arange(-max_shift, max_shift + 1)
    cost = shift_cost * np.abs(shifts)
    rows, last = best.shape[1], best.shape[2] - 1
    paths = np.empty((len(ends), rows), np.intp)
    paths[:, -1] = at = np.asarray(ends, np.intp)
    for row in range(rows - 1, 0, -1):
        whence = at[:, None] + shifts
        near = best[grids[:, None], row - 1, np.clip(whence, 0, last)] - cost
        # A column beyond the border repeats the border's with a higher cost, so it is never chosen.
        at = np.clip(at + near.argmax(axis=1) - max_shift, 0, last)
        paths[:, row - 1] = at
    return paths
