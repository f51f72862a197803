"""The best closed path round a grid of rays, by dynamic programming."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from services.arrays import Floats


def find_closed_path(score: Floats, max_shift: int, shift_cost: float) -> NDArray[np.intp]:
    """Sample indices (N,), one a ray, whose `score` (N rays, M samples) is greatest in sum, on a closed path.

    From ray to ray the index changes by `max_shift` at most, which costs `shift_cost` a sample. Samples with a
    score of -inf are never used. The rays are run through one and a third times, and the middle turn is taken:
    a sixth of a turn is enough to forget where it started.
    """
    rays, samples = score.shape
    order = np.arange(rays + rays // 3) % rays
    shifts = np.arange(-max_shift, max_shift + 1)
    cost = shift_cost * np.abs(shifts)[:, None]
    padded = np.full(samples + 2 * max_shift, -np.inf)
    inner = padded[max_shift : max_shift + samples]
    history = np.empty((len(order), samples))
    inner[:] = history[0] = score[order[0]]
    windows = sliding_window_view(padded, samples)
    work = np.empty(windows.shape)
    for step, ray in enumerate(order[1:], start=1):
        np.subtract(windows, cost, out=work)
        np.add(np.maximum.reduce(work, axis=0), score[ray], out=inner)
        history[step] = inner
    path = np.empty(len(order), np.intp)
    path[-1] = int(np.argmax(history[-1]))
    for step in range(len(order) - 1, 0, -1):
        low = max(int(path[step]) - max_shift, 0)
        near = np.arange(low, min(int(path[step]) + max_shift + 1, samples))
        path[step - 1] = near[np.argmax(history[step - 1, near] - shift_cost * np.abs(near - path[step]))]
    first = rays // 6
    chosen = path[first : first + rays]
    return np.asarray(np.roll(chosen, first), np.intp)
