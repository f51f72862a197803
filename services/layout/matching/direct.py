"""Direct many-to-one labelling: finds a good labelling, then proves that it is optimal or bounds its gap."""

import time

import numpy as np

from services.layout.matching.bounded_problem import BoundedProblem, reduced, whole_problem
from services.layout.matching.branch_and_bound import search
from services.layout.matching.cost_tables import CostTables, Matching
from services.layout.matching.dual_ascent import DualAscent
from services.layout.matching.labelling import Labels, Neighbours
from services.layout.matching.local_search import improve, starts
from services.layout.matching.parameters import LEAST_GAIN, MatchingParameters

_FEW = 0.7
"""The problem is reduced when at most this share of its labels remains, since passes are then faster."""

_STEP = 0.7
"""Relaxation of the price updates: each price is computed with the others fixed, and with 1 they oscillate."""
_SECOND, _THIRD = 3, 5
"""The passes after which local search starts again: from the second start, and from what looked best in the pass."""
_SMALL = 50
"""Labels left to all zones together which branch and bound decides sooner than a further pass."""
_MOST_PASSED = 12_000_000
"""Entries of pairs in all passes together: 12 over those of 200 zones of which a fifth of the pairs has costs."""
_MOST_COPIED = 6_000_000
"""Entries of pairs of which copies are made (48 MB each); the bound of larger tables is the plain one."""
_STALLED = 0.9
"""Passes end when one leaves more than this share of the gap."""


def match_directly(tables: CostTables, parameters: MatchingParameters) -> Matching:
    """The labelling of least cost that was found, with a lower bound.

    Local search from a few starts gives an upper bound. Message passing raises a lower bound and removes labels that
    cannot be in a better labelling. Branch and bound decides the rest.
    """
    stop_at = time.thread_time() + parameters.max_ms / 1000
    if tables.zones == 0 or tables.labels == 1:
        labels = np.zeros(tables.zones, np.intp)
        cost = tables.cost(labels)
        return Matching(labels, cost, cost, True, 0)
    neighbours = Neighbours(tables)
    found = _Found(tables, neighbours)
    start, second = starts(tables, neighbours)
    found.offer(start)
    if tables.edge.size > _MOST_COPIED:
        found.offer(second)
        least = tables.node.min(1).sum() + tables.edge.min(axis=(1, 2)).sum() + tables.count.min(1).sum()
        return Matching(found.labels, found.cost, min(float(least) - found.tolerance, found.cost), False, 0)
    sweeps = min(parameters.max_sweeps, max(2, _MOST_PASSED // max(1, tables.edge.size)))
    problem = _raise_bound(whole_problem(tables, neighbours), found, second, sweeps, stop_at)
    bound, explored = problem.constant, 0
    if bound < found.cost - found.tolerance:
        result = search(problem, found.cost, found.tolerance, parameters.max_nodes, stop_at)
        bound, explored = max(bound, result.lower_bound), result.explored
        if result.choice is not None:
            found.offer(problem.labelling(result.choice))
    if bound < found.cost - found.tolerance:
        found.offer(second)
        found.offer(found.labels, groups=True)
    optimal = bound >= found.cost - 2 * found.tolerance
    lower = found.cost if optimal else min(bound - found.tolerance, found.cost)
    return Matching(found.labels, found.cost, lower, optimal, explored)


class _Found:
    """The best labelling that was found yet."""

    def __init__(self, tables: CostTables, neighbours: Neighbours) -> None:
        self._tables, self._neighbours = tables, neighbours
        self._offered: set[bytes] = set()
        self.labels: Labels = np.zeros(tables.zones, np.intp)
        self.cost = tables.cost(self.labels)

    @property
    def tolerance(self) -> float:
        return LEAST_GAIN * (1.0 + abs(self.cost))

    def offer(self, start: Labels, *, groups: bool = False) -> None:
        """Improve `start` by local search, once, and keep what is better."""
        key = start.tobytes()
        if key in self._offered and not groups:
            return
        self._offered.add(key)
        labels, cost = improve(self._tables, self._neighbours, start, groups=groups)
        self._offered.add(labels.tobytes())
        if cost < self.cost:
            self.labels, self.cost = labels, cost


def _raise_bound(
    problem: BoundedProblem, found: _Found, second: Labels, max_sweeps: int, stop_at: float
) -> BoundedProblem:
    """Forward and backward passes until the bound meets the cost, stops rising, or the budget ends; the rest of it."""
    if max_sweeps == 0:
        return problem
    ascent = DualAscent(problem)
    ascent.start_from(found.labels)
    last = np.inf
    for step in range(max_sweeps):
        choice = ascent.sweep(backward=step % 2 == 1)
        gap = found.cost - problem.constant
        if gap <= found.tolerance:
            break
        if step == _SECOND:
            found.offer(second)
        if step == _THIRD:
            found.offer(problem.labelling(choice))
        keep = ascent.reach < found.cost - found.tolerance
        keep[np.arange(problem.size), np.where(keep, ascent.seen, np.inf).argmin(1)] = True
        if keep.sum() <= _FEW * problem.sizes.sum():
            ascent.settle()
            problem = reduced(problem, keep)
            if problem.sizes.sum() <= _SMALL:
                return problem
            ascent = DualAscent(problem)
        elif gap > _STALLED * last:
            break
        last = gap
        if time.thread_time() > stop_at:
            break
        ascent.price_counts(_STEP)
    ascent.settle()
    return problem
