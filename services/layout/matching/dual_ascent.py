"""Sequential message passing over pairs: it raises the lower bound of a problem and finds labels to remove.

One pass goes through the zones in order (or back). At each zone, what its pairs with the zones before cost at
least for each of its labels moves into the zone; the least of the sum moves into the constant; the rest is
shared out to its pairs with the zones to come (TRW-S, Kolmogorov 2006, as block coordinate ascent on the dual of
the local polytope: the constant never falls). The costs of counts take part by a price for each label.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from services.layout.matching.bounded_problem import BoundedProblem
from services.layout.matching.labelling import Floats, Labels

_SPLIT = 0.4
"""Of a pair's cost to each of its zones at the start; 0.3-0.5 are alike, less starts lower."""
_Index = slice | NDArray[np.intp]


class DualAscent:
    """Passes over one problem, whose `node` and `constant` it changes; `settle` hands over its pairs too.

    `seen` (R, K): what each zone's label cost above the least one when the zone was last passed, all of its pairs
    gathered. `reach` (R, K): the most that was ever proved of the least cost with this label.
    """

    def __init__(self, problem: BoundedProblem) -> None:
        self.problem = problem
        self.seen = problem.node.copy()
        self.reach = problem.constant + problem.node
        self._started = True
        size, width = problem.node.shape
        low, high = problem.low, problem.high
        # moved[:, r, q] is the cost that pair (r, q) has moved to zone r's labels
        self._moved = np.zeros((width, size, size))
        starts = np.searchsorted(low, np.arange(size + 1)).tolist()
        order = np.argsort(high, kind="stable")
        ends = np.searchsorted(high[order], np.arange(size + 1)).tolist()
        self._before: list[tuple[_Index, Floats]] = []
        self._after: list[tuple[_Index, Floats]] = []
        for r in range(size):
            own = order[ends[r] : ends[r + 1]]
            table = np.ascontiguousarray(problem.pair[own].transpose(1, 2, 0))
            self._before.append((_span(low[own]), table))
            span = slice(starts[r], starts[r + 1])
            table = np.ascontiguousarray(problem.pair[span].transpose(2, 1, 0))
            self._after.append((_span(high[span]), table))

    def start_from(self, labels: Labels) -> None:
        """Split every pair between its zones by what each of their labels would cost with the other's in `labels`.

        Near the least labelling such costs are nearly what the passes arrive at. What pairs are left with may be
        negative until one pass has gone over them, so the constant is a bound only after it.
        """
        problem, moved = self.problem, self._moved
        low, high = problem.low, problem.high
        e = np.arange(len(low))
        moved[:, low, high] = _SPLIT * problem.pair[e, :, labels[high]].T
        moved[:, high, low] = _SPLIT * problem.pair[e, labels[low]].T
        problem.node += moved.sum(2).T
        self.reach[:] = -np.inf
        self._started = False

    def sweep(self, backward: bool) -> Labels:
        """One pass; returns places (R,) that look best on the way."""
        problem, moved, seen = self.problem, self._moved, self.seen
        node, constant = problem.node, problem.constant
        size = problem.size
        lowest, total = np.minimum.reduce, np.add.reduce  # called often; ndarray.min takes a microsecond more
        constants = [0.0] * size
        gather, spread = (self._after, self._before) if backward else (self._before, self._after)
        for r in range(size - 1, -1, -1) if backward else range(size):
            own = node[r]
            others, table = gather[r]
            count_in = table.shape[2]
            if count_in:
                given = lowest(table - moved[:, others, r][:, None, :])
                own += total(given - moved[:, r, others], 1)
                moved[:, r, others] = given
            least = float(lowest(own))
            constant += least
            own -= least
            seen[r] = own
            constants[r] = constant
            others, table = spread[r]
            count_out = table.shape[2]
            if count_out:
                share = 1.0 / max(count_in, count_out)
                moved[:, r, others] -= (share * own)[:, None]
                own *= 1.0 - count_out * share
        problem.constant = constant
        if self._started:
            np.maximum(self.reach, seen + np.array(constants)[:, None], out=self.reach)
        else:
            self.reach = constant + node
            self._started = True
        best: Labels = seen.argmin(1)
        return best

    def settle(self) -> None:
        """Write what was moved into the problem's pairs."""
        problem = self.problem
        problem.pair = problem.pair - self._moved[:, problem.low, problem.high].T[:, :, None]
        problem.pair -= self._moved[:, problem.high, problem.low].T[:, None, :]
        np.maximum(problem.pair, 0.0, out=problem.pair)  # rounding
        self._moved[:] = 0.0

    def price_counts(self, step: float) -> None:
        """Move the prices of labels towards those that the costs of counts and the zones agree on.

        For one label, with the others as they are, the zones that would gain most by it are counted until the cost
        of one more exceeds the gain; the price lies between the gains of the last one in and the first one out.
        """
        problem = self.problem
        count, names, real = problem.count, problem.names, problem.real
        labels, counts = count.shape
        rows = np.arange(labels)
        cost = np.full((problem.size, labels), np.inf)
        cost[np.nonzero(real)[0], names[real]] = self.seen[real]
        nearest = np.partition(cost, 1, axis=1)
        least = nearest[:, :1]
        gain = np.where(cost <= least, nearest[:, 1:2], least) - cost
        gain.sort(axis=0)
        falling = np.full((labels, counts + 1), np.inf)
        falling[:, 1:-1] = gain.T[:, ::-1]
        falling[:, -1] = -np.inf
        # cost of having n zones, those that gain most; what lies on its lower hull next to the best n bounds the price
        total = count.copy()
        total[:, 1:] -= np.cumsum(np.maximum(falling[:, 1:-1], -_FAR), axis=1)
        best = total.argmin(1)
        with np.errstate(invalid="ignore"):
            slope = (count - count[rows, best][:, None]) * _inverse(counts)[best]
        behind = np.arange(counts) < best[:, None]
        low = np.maximum(np.where(behind, slope, -np.inf).max(1), falling[rows, best + 1])
        ahead = np.arange(counts) > best[:, None]
        high = np.minimum(np.where(ahead, slope, np.inf).min(1), falling[rows, best])
        low = np.where(low > -_FAR, low, high)
        high = np.where(high < _FAR, high, low)
        price = step / 2 * (low + high)
        problem.move_counts(np.where(np.abs(price) < _FAR, price, 0.0))


_FAR = 1e30
"""Cost of a label that a zone cannot have, larger than every other cost."""


@cache
def _inverse(counts: int) -> Floats:
    """(n, n): 1 over the difference of column and row, 0 on the diagonal."""
    difference = np.arange(counts, dtype=float) - np.arange(counts)[:, None]
    return np.divide(1.0, difference, out=np.zeros_like(difference), where=difference != 0)


def _span(index: NDArray[np.intp]) -> _Index:
    """`index` as a slice where it is one: all zones before or after, of a page where every pair counts."""
    if len(index) and int(index[-1]) - int(index[0]) == len(index) - 1:
        return slice(int(index[0]), int(index[-1]) + 1)
    return index
