"""Reading order of zones, by the partial order of columns.

Source: T. Breuel, "High performance document layout analysis", 2003: a zone comes before another of its columns
that lies below it, and before one to its right unless a third lies between both in the page's rows and
spans their columns.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from services.layout.page import Box

_MOST = 300
"""More zones are sorted by rows, since the table of the order grows with the third power."""


def reading_order(boxes: Sequence[Box], *, heads_first: bool = False) -> list[int]:
    """Indices of boxes (x0, y0, x1, y1) as they are read: by columns, left to right in rows without any.

    With `heads_first` a zone to the right that lies above comes later only where columns stand beside each other, which
    Breuel's rule does not ask: by it a centred letterhead follows the short lines at the left margin below it.
    """
    table = np.array(boxes, dtype=np.float64).reshape(-1, 4)
    by_rows = np.lexsort((table[:, 0], table[:, 1]))
    if len(table) > _MOST:
        return [int(index) for index in by_rows]
    return _sort(_comes_before(table, heads_first=heads_first), by_rows)


def _comes_before(boxes: NDArray[np.float64], *, heads_first: bool) -> NDArray[np.bool_]:
    x0, y0, x1, y1 = boxes.T
    width = x1 - x0
    shared = np.minimum(x1[:, None], x1) - np.maximum(x0[:, None], x0)
    # Neighbours may touch; a sliver in common is no common column.
    share_columns = shared > 0.05 * np.minimum(width[:, None], width)
    rows_shared = np.minimum(y1[:, None], y1) - np.maximum(y0[:, None], y0)
    same_row = rows_shared > 0.5 * np.minimum((y1 - y0)[:, None], y1 - y0)
    centre = (y0 + y1) / 2
    above = share_columns & (centre[:, None] < centre) & ~(same_row & (shared < 0.5 * width.clip(1e-9)))
    left = ~share_columns & (x0[:, None] + x1[:, None] < x0 + x1)
    if heads_first:
        wholly_below = y0[:, None] >= y1
        left &= ~wholly_below | _have_columns(share_columns, rows_shared > 0)
    # between[a, b]: some c spans columns of both a and b and lies between them in the rows.
    low = np.minimum(centre[:, None], centre)
    high = np.maximum(centre[:, None], centre)
    between = np.zeros_like(left)
    for c in range(len(boxes)):
        spans = share_columns[c][:, None] & share_columns[c][None, :]
        between |= spans & (centre[c] > low) & (centre[c] < high)
    before = above | (left & (same_row | ~between))
    np.fill_diagonal(before, False)
    return np.asarray(before, dtype=np.bool_)


def _have_columns(share_columns: NDArray[np.bool_], share_rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Of two zones a and b (N, N): whether a zone of b's column stands beside one of a's column, in no column of a."""
    columns = share_columns.astype(np.int32)
    beside = (share_rows & ~share_columns).astype(np.int32)
    beside_column = (columns @ beside > 0) & ~share_columns
    return np.asarray(beside_column.astype(np.int32) @ columns > 0, dtype=np.bool_)


def _sort(before: NDArray[np.bool_], by_rows: NDArray[np.intp]) -> list[int]:
    """Topological order; of several that may follow, and where the order runs in circles, the first by rows."""
    waiting = before.copy()
    left = [int(index) for index in by_rows]
    order: list[int] = []
    while left:
        pending = waiting[left][:, left].sum(axis=0)
        free = [index for index, count in zip(left, pending, strict=True) if count == 0]
        chosen = _next(free, order, before) if free else left[int(np.argmin(pending))]
        order.append(chosen)
        left.remove(chosen)
    return order


def _next(free: list[int], order: list[int], before: NDArray[np.bool_]) -> int:
    """Of the zones that may come, one that the last one leads to, else the first."""
    if order:
        followers = [index for index in free if before[order[-1], index]]
        if followers:
            return followers[0]
    return free[0]
