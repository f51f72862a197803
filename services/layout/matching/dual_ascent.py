"""Sequential message passing over pairs that lifts the lower bound of a problem and drops labels.

One pass goes through the zones in order (or back). At each zone, what its pairs with the zones before cost at
least for each of its labels moves into the zone; the least of the sum moves into the constant; the rest is
shared out to its pairs with the zones to come (TRW-S, Kolmogorov 2006, as block coordinate ascent on the dual of
the local polytope: the constant never falls). The costs of counts take part by a price for each label.
"""

import numpy as np
from numpy.typing import NDArray

from services.layout.matching.bounded_problem import BoundedProblem
from services.layout.matching.labelling import Floats, Labels

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
        size, width = problem.node.shape
        low, high = problem.low, problem.high
        # moved[:, r, q] is what pair (r, q) has given to zone r's labels
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

    def sweep(self, backward: bool) -> Labels:
        """One pass; returns places (R,) that look best on the way."""
        problem, moved, seen = self.problem, self._moved, self.seen
        node, constant = problem.node, problem.constant
        size = problem.size
        constants = [0.0] * size
        gather, spread = (self._after, self._before) if backward else (self._before, self._after)
        for r in range(size - 1, -1, -1) if backward else range(size):
            own = node[r]
            others, table = gather[r]
            count_in = table.shape[2]
            if count_in:
                given = (table - moved[:, others, r][:, None, :]).min(0)
                own += (given - moved[:, r, others]).sum(1)
                moved[:, r, others] = given
            least = float(own.min())
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
        np.maximum(self.reach, seen + np.array(constants)[:, None], out=self.reach)
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
        labels, counts = problem.count.shape
        real = np.arange(problem.names.shape[1]) < problem.sizes[:, None]
        cost = np.full((problem.size, labels), np.inf)
        rows = np.broadcast_to(np.arange(problem.size)[:, None], problem.names.shape)
        cost[rows[real], problem.names[real]] = self.seen[real]
        nearest = np.partition(cost, 1, axis=1)[:, :2]
        other = np.where(cost <= nearest[:, :1], nearest[:, 1:], nearest[:, :1])
        gain = -np.sort(cost - other, axis=0)  # falling; -inf where a zone cannot have the label
        total = np.zeros((labels, counts))
        np.cumsum(np.maximum(gain, -1e30).T, axis=1, out=total[:, 1:])
        best = np.argmin(problem.count - total, axis=1)
        steps = np.arange(counts) - best[:, None]
        at_best = np.take_along_axis(problem.count, best[:, None], 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (problem.count - at_best) / steps
        below = np.where(steps < 0, slope, -np.inf).max(1)
        above = np.where(steps > 0, slope, np.inf).min(1)
        edge = np.full((1, labels), np.inf)
        bounded = np.vstack([edge, gain, -edge])
        upper = np.take_along_axis(bounded, best[None], 0)[0]
        lower = np.take_along_axis(bounded, best[None] + 1, 0)[0]
        low, high = np.maximum(below, lower), np.minimum(above, upper)
        low = np.where(np.isfinite(low), low, high)
        high = np.where(np.isfinite(high), high, low)
        price = np.zeros(labels)
        np.add(low / 2, high / 2, out=price, where=np.isfinite(low) & np.isfinite(high))
        problem.move_counts(step * price)


def _span(index: NDArray[np.intp]) -> _Index:
    """`index` as a slice where it is one: all zones before or after, of a page where every pair counts."""
    if len(index) and int(index[-1]) - int(index[0]) == len(index) - 1:
        return slice(int(index[0]), int(index[-1]) + 1)
    return index
