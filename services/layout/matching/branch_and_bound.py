"""Exact depth-first search over what bounds have left open, cheapest branch first."""

import time
from dataclasses import dataclass

import numpy as np

from services.layout.matching.bounded_problem import BoundedProblem
from services.layout.matching.labelling import Floats, Labels

_MOST_COUPLINGS = 4_000_000
"""Of (zone, label) with (zone, label), 32 MB; larger problems are not searched, and their gap is told."""


@dataclass(frozen=True, slots=True, eq=False)
class Searched:
    """`choice` (R,) of least `cost` if it is below the one given, else None; `lower_bound` holds for what is not
    searched as well; `explored` zones were opened."""

    choice: Labels | None
    cost: float
    lower_bound: float
    explored: int


@dataclass(slots=True, eq=False)
class _Branch:
    """Zone `depth` is to be decided. `ahead` (R - depth, K) are the costs of it and of all zones after it, with
    their pairs with the decided ones; `spent` is the cost of those, `counts` (L,) their labels."""

    bound: float
    depth: int
    spent: float
    ahead: Floats
    counts: Labels
    choice: list[int]


def search(
    problem: BoundedProblem, below: float, tolerance: float, max_nodes: int, stop_at: float
) -> Searched:
    """The least cost under `below` by more than `tolerance`, or the proof that there is none.

    Opens `max_nodes` zones, and none after `stop_at` (of time.perf_counter). The branch's bound is its cost so far,
    with the least costs of the zones to come given the decided ones, and of the counts they may still reach.
    """
    size, width = problem.node.shape
    if size == 0:
        found = problem.constant < below - tolerance
        empty = np.zeros(0, np.intp)
        return Searched(empty if found else None, min(below, problem.constant), problem.constant, 0)
    if (size * width) ** 2 > _MOST_COUPLINGS:
        return Searched(None, below, problem.constant, 0)
    coupling = np.zeros((size, width, size, width))
    coupling[problem.low, :, problem.high, :] = problem.pair
    count = _reachable(problem)
    rows = np.arange(len(problem.count))
    best, limit, explored = None, below, 0
    root = _Branch(problem.constant, 0, problem.constant, problem.node, np.zeros(len(rows), np.intp), [])
    stack = [root]
    while stack:
        branch = stack[-1]
        if branch.bound >= limit - tolerance:
            stack.pop()
            continue
        if explored >= max_nodes or time.perf_counter() > stop_at:
            break
        stack.pop()
        explored += 1
        depth = branch.depth
        k = int(problem.sizes[depth])
        names = problem.names[depth, :k]
        at = branch.counts
        to_come = count[depth + 1]
        now = to_come[rows, at]
        spent = branch.spent + branch.ahead[0, :k]
        ahead = branch.ahead[1:] + coupling[depth, :k, depth + 1 :]
        bounds = spent + ahead.min(2).sum(1) + (now.sum() + to_come[names, at[names] + 1] - now[names])
        if depth + 1 == size:
            c = int(bounds.argmin())
            if bounds[c] < limit - tolerance:
                limit, best = float(bounds[c]), [*branch.choice, c]
            continue
        for c in np.argsort(-bounds, kind="stable").tolist():
            if bounds[c] < limit - tolerance:
                counts = at.copy()
                counts[names[c]] += 1
                stack.append(
                    _Branch(
                        float(bounds[c]), depth + 1, float(spent[c]), ahead[c], counts, [*branch.choice, c]
                    )
                )
    lower = min([limit, *(branch.bound for branch in stack)])
    choice = None if best is None else np.array(best, np.intp)
    return Searched(choice, limit, lower, explored)


def _reachable(problem: BoundedProblem) -> Floats:
    """(R + 1, L, R + 1): the least cost of a label's count, given how many of the first zones have it."""
    size = problem.size
    out = np.empty((size + 1, *problem.count.shape))
    out[size] = problem.count
    for depth in range(size - 1, -1, -1):
        names = problem.names[depth, : problem.sizes[depth]]
        out[depth] = out[depth + 1]
        # the zone may take the label or not
        out[depth, names, :-1] = np.minimum(out[depth + 1, names, :-1], out[depth + 1, names, 1:])
    return out
