"""The best path across a grid of rays, closed or open, by dynamic programming."""

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
    rays = len(score)
    order = np.arange(rays + rays // 3) % rays
    first = rays // 6
    path = find_open_path(score[order], max_shift, shift_cost)[first : first + rays]
    return np.asarray(np.roll(path, first), np.intp)


def find_open_path(score: Floats, max_shift: int, shift_cost: float) -> NDArray[np.intp]:
    """As `find_closed_path`, from the first ray to the last."""
    rays, samples = score.shape
    cost = shift_cost * np.abs(np.arange(-max_shift, max_shift + 1))[:, None]
    padded = np.full(samples + 2 * max_shift, -np.inf)
    inner = padded[max_shift : max_shift + samples]
    windows = sliding_window_view(padded, samples)
    work = np.empty(windows.shape)
    history = np.empty((rays, samples))
    inner[:] = history[0] = score[0]
    for ray in range(1, rays):
        np.subtract(windows, cost, out=work)
        np.add(np.maximum.reduce(work, axis=0), score[ray], out=inner)
        history[ray] = inner
    path = np.empty(rays, np.intp)
    at = path[-1] = int(history[-1].argmax())
    price = cost[:, 0]
    for ray in range(rays - 1, 0, -1):
        low, high = max(at - max_shift, 0), min(at + max_shift + 1, samples)
        near = history[ray - 1, low:high] - price[low - at + max_shift : high - at + max_shift]
        at = path[ray - 1] = low + int(near.argmax())
    return path
