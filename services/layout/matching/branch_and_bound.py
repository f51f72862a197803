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
    """`bound` is of all its leaves; `plain`, at most as high, counts no zone's cost above its least one.

    `free` (F,) zones are to be decided. `ahead` (F, K) are their costs, with their pairs with the decided ones;
    `spent` is the cost of those, `counts` (L,) are their labels, `choice` (R,) their places."""

    bound: float
    plain: float
    free: Labels
    spent: float
    ahead: Floats
    counts: Labels
    choice: Labels


def search(
    problem: BoundedProblem, below: float, tolerance: float, max_nodes: int, stop_at: float
) -> Searched:
    """The least cost under `below` by more than `tolerance`, or the proof that there is none.

    Opens `max_nodes` zones, and none after `stop_at` (of time.perf_counter). The bound of a branch is its cost so
    far, with the least costs of the zones to come given the decided ones, and of the counts they may still reach. The
    zone that is decided next is the one whose second best label costs most above its best: most often its others go
    at once.
    """
    size, width = problem.node.shape
    if size == 0:
        found = problem.constant < below - tolerance
        empty = np.zeros(0, np.intp)
        return Searched(empty if found else None, min(below, problem.constant), problem.constant, 0)
    if (size * width) ** 2 > _MOST_COUPLINGS or max_nodes == 0:
        return Searched(None, below, problem.constant, 0)
    coupling = np.zeros((size, width, size, width))
    coupling[problem.low, :, problem.high, :] = problem.pair
    coupling[problem.high, :, problem.low, :] = problem.pair.transpose(0, 2, 1)
    reachable = _reachable(problem.count)
    rows = np.arange(len(problem.count))
    best, limit, explored = None, below, 0
    node = np.where(problem.real, problem.node, np.inf)
    # places that repeat a label go to a row of their own, which nobody reads
    slots = np.where(problem.real, problem.names, len(rows))
    none = np.zeros(len(rows), np.intp)
    stack = [
        _Branch(
            problem.constant,
            problem.constant,
            np.arange(size),
            problem.constant,
            node,
            none,
            np.zeros(size, np.intp),
        )
    ]
    while stack:
        branch = stack[-1]
        if branch.bound >= limit - tolerance:
            stack.pop()
            continue
        if explored >= max_nodes or time.perf_counter() > stop_at:
            break
        stack.pop()
        explored += 1
        least = np.partition(branch.ahead, 1, axis=1)
        place = int((least[:, 1] - least[:, 0]).argmax())
        zone, own = int(branch.free[place]), branch.ahead[place]
        open_ = np.flatnonzero(branch.plain + own - least[place, 0] < limit - tolerance)
        rest = np.arange(len(branch.free)) != place
        free = branch.free[rest]
        names, at = problem.names[zone, open_], branch.counts
        to_come = reachable[len(free)]
        now = to_come[rows, at]
        spent = branch.spent + own[open_]
        ahead = branch.ahead[rest] + coupling[zone, open_][:, free]
        alone = spent + np.add.reduce(np.minimum.reduce(ahead, 2), 1)
        counts = at + (rows == names[:, None])
        plain = alone + now.sum() + to_come[names, at[names] + 1] - now[names]
        bounds = plain.copy()
        hopeful = np.flatnonzero(bounds < limit - tolerance)
        if len(free) and len(hopeful):
            bounds[hopeful] = alone[hopeful] + _counts_ahead(
                problem.count, slots[free], ahead[hopeful], counts[hopeful]
            )
        for c in np.argsort(-bounds, kind="stable").tolist():
            if bounds[c] >= limit - tolerance:
                continue
            choice = branch.choice.copy()
            choice[zone] = open_[c]
            if len(free) == 0:
                limit, best = float(bounds[c]), choice
                continue
            stack.append(
                _Branch(float(bounds[c]), float(plain[c]), free, float(spent[c]), ahead[c], counts[c], choice)
            )
    lower = min([limit, *(branch.bound for branch in stack)])
    return Searched(best, limit, lower, explored)


def _counts_ahead(count: Floats, slots: Labels, ahead: Floats, counts: Labels) -> Floats:
    """(C,): what counts cost at least in each child, with what the zones to come cost more than their best labels.

    A zone has but one label, so its costs above its least one belong to the labels one by one: a label that n of
    the zones take costs no less than count n and the n least of these together.
    """
    children, zones, _ = ahead.shape
    labels = len(count)
    extra = np.full((children, labels + 1, zones), np.inf)
    extra[:, slots, np.arange(zones)[:, None]] = ahead - np.minimum.reduce(ahead, 2)[:, :, None]
    extra = extra[:, :labels]
    extra.sort(axis=2)
    n = counts[:, :, None] + np.arange(zones + 1)
    cost = count[np.arange(labels)[:, None], n]
    cost[:, :, 1:] += np.add.accumulate(extra, 2)
    return np.add.reduce(np.minimum.reduce(cost, 2), 1)


def _reachable(count: Floats) -> Floats:
    """(R + 1, L, R + 1): the least cost of a label's count n when as many zones as the first index are to come."""
    out = np.empty((count.shape[1], *count.shape))
    out[0] = count
    for to_come in range(1, len(out)):
        out[to_come] = out[to_come - 1]
        np.minimum(out[to_come, :, :-1], out[to_come - 1, :, 1:], out=out[to_come, :, :-1])
    return out
