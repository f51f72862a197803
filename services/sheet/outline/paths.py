"""The best paths across grids of rays, closed or open, by dynamic programming."""

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats
from services.imaging.grid_paths import accumulate_to_row, trace_back


def find_closed_paths(score: Floats, max_shift: int, shift_cost: float) -> NDArray[np.intp]:
    """Sample indices (G, N), one a ray, whose `score` (G, N rays, M samples) is greatest in sum, on closed paths.

    From ray to ray the index changes by `max_shift` at most, which costs `shift_cost` a sample. Samples with a
    score of -inf are never used. The rays are run through one and a third times, and the middle turn is taken:
    a sixth of a turn is enough to forget where it started.
    """
    rays = score.shape[1]
    order = np.arange(rays + rays // 3) % rays
    first = rays // 6
    paths = find_open_paths(score[:, order], max_shift, shift_cost)[:, first : first + rays]
    return np.asarray(np.roll(paths, first, axis=1), np.intp)


def find_open_paths(score: Floats, max_shift: int, shift_cost: float) -> NDArray[np.intp]:
    """As `find_closed_paths`, from the first ray to the last."""
    middle = score.shape[1] // 2
    down, up = accumulate_to_row(score, middle, max_shift, shift_cost)
    there = score[:, middle]
    through = down[:, -1] + np.where(np.isfinite(there), up[:, -1] - np.nan_to_num(there), -np.inf)
    grids, at = np.arange(len(score)), through.argmax(axis=1)
    above, below = (trace_back(half, grids, at, max_shift, shift_cost) for half in (down, up))
    return np.concatenate([above, below[:, :-1][:, ::-1]], axis=1)
