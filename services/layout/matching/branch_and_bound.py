"""Exact depth-first search over the labels that bounds have not removed, cheapest branch first."""

import time
from dataclasses import dataclass

import numpy as np

from services.layout.matching.bounded_problem import BoundedProblem
from services.layout.matching.labelling import Floats, Labels

_MOST_COUPLINGS = 4_000_000
"""Of (zone, label) with (zone, label), 32 MB; larger problems are not searched, and their gap is reported."""
_USUAL_ZONES = 30
"""Up to this number of zones a step of the search takes constant time, which function calls dominate."""


@dataclass(frozen=True, slots=True, eq=False)
class Searched:
    """The result of a search.

    `choice` (R,) has the least `cost` if that is below the given cost, else it is None. `lower_bound` also holds for
    the part that was not searched. `explored` is the number of opened zones.
    """

    choice: Labels | None
    cost: float
    lower_bound: float
    explored: int


@dataclass(slots=True, eq=False)
class _Branch:
    """`bound` is of all its leaves; `plain`, at most as high, leaves out what counts make zones pay.

    `free` (F,) zones are to be decided. `ahead` (F, K) are their costs, with their pairs with the decided ones;
    `spent` is the cost of those, `counts` (L,) are their labels, `choice` (R,) their places.
    """

    bound: float
    plain: float
    spent: float
    free: Labels
    ahead: Floats
    counts: Labels
    choice: Labels


def search(
    problem: BoundedProblem, below: float, tolerance: float, max_nodes: int, stop_at: float
) -> Searched:
    """The least cost below `below` by more than `tolerance`, or the proof that no such labelling exists.

    Opens `max_nodes` zones, fewer where more than `_USUAL_ZONES` are left, as each then costs more; and none after
    `stop_at` (of time.thread_time).
    """
    size, width = problem.node.shape
    if size == 0:
        found = problem.constant < below - tolerance
        empty = np.zeros(0, np.intp)
        return Searched(empty if found else None, min(below, problem.constant), problem.constant, 0)
    if (size * width) ** 2 > _MOST_COUPLINGS or max_nodes == 0:
        return Searched(None, below, problem.constant, 0)
    max_nodes = max(1, round(max_nodes * min(1.0, _USUAL_ZONES / size)))
    branching = _Branching(problem)
    best, limit, explored = None, below, 0
    stack = [branching.root()]
    while stack:
        if stack[-1].bound >= limit - tolerance:
            stack.pop()
            continue
        if explored >= max_nodes or time.thread_time() > stop_at:
            break
        explored += 1
        children = branching.open(stack.pop(), limit - tolerance)
        if children and len(children[-1].free) == 0:
            limit, best = children[-1].bound, children[-1].choice
        else:
            stack += children
    lower = min([limit, *(branch.bound for branch in stack)])
    return Searched(best, limit, lower, explored)


class _Branching:
    """Data that all branches of one problem share."""

    def __init__(self, problem: BoundedProblem) -> None:
        size, width = problem.node.shape
        labels = len(problem.count)
        self._problem = problem
        self._coupling = np.zeros((size, width, size, width))
        self._coupling[problem.low, :, problem.high, :] = problem.pair
        self._coupling[problem.high, :, problem.low, :] = problem.pair.transpose(0, 2, 1)
        self._rows = np.arange(labels)
        # places that repeat a label go to an extra row, which is not used
        self._slots = np.where(problem.real, problem.names, labels)
        self._reachable = _reachable(problem.count)

    def root(self) -> _Branch:
        """Nothing is decided."""
        problem, size = self._problem, self._problem.size
        node = np.where(problem.real, problem.node, np.inf)
        counts, choice = np.zeros(len(self._rows), np.intp), np.zeros(size, np.intp)
        bound = problem.constant
        return _Branch(bound, bound, bound, np.arange(size), node, counts, choice)

    def open(self, branch: _Branch, limit: float) -> list[_Branch]:
        """The branches for each label of one more zone, the cheapest last, without those that reach `limit`.

        The zone is the one whose second best label costs most above its best: most often its others go at once. A
        branch's bound is its cost so far, with the least costs of the zones to come given the decided ones, and of
        the counts they may still reach.
        """
        least = np.partition(branch.ahead, 1, axis=1)
        place = int((least[:, 1] - least[:, 0]).argmax())
        zone, own = int(branch.free[place]), branch.ahead[place]
        options = np.flatnonzero(branch.plain + own - least[place, 0] < limit)
        rest = np.arange(len(branch.free)) != place
        free = branch.free[rest]
        names = self._problem.names[zone, options]
        counts = branch.counts + (self._rows == names[:, None])
        spent = branch.spent + own[options]
        ahead = branch.ahead[rest] + self._coupling[zone, options][:, free]
        alone = spent + np.add.reduce(np.minimum.reduce(ahead, 2), 1)
        plain = alone + np.add.reduce(self._reachable[len(free)][self._rows, counts], 1)
        bounds = plain.copy()
        hopeful = np.flatnonzero(plain < limit)
        if len(free) and len(hopeful):
            bounds[hopeful] = alone[hopeful] + self._counts_ahead(free, ahead[hopeful], counts[hopeful])
        children = []
        for c in np.argsort(-bounds, kind="stable").tolist():
            if bounds[c] < limit:
                choice = branch.choice.copy()
                choice[zone] = options[c]
                children.append(
                    _Branch(
                        float(bounds[c]), float(plain[c]), float(spent[c]), free, ahead[c], counts[c], choice
                    )
                )
        return children

    def _counts_ahead(self, free: Labels, ahead: Floats, counts: Labels) -> Floats:
        """(C,): the least that counts cost in each child, with what the zones to come cost above their least labels.

        A zone has but one label, so its costs above its least one belong to the labels one by one: a label that n of
        the zones take costs no less than count n and the n least of these together.
        """
        children, zones, _ = ahead.shape
        labels = len(self._rows)
        extra = np.full((children, labels + 1, zones), np.inf)
        above = ahead - np.minimum.reduce(ahead, 2)[:, :, None]
        extra[:, self._slots[free], np.arange(zones)[:, None]] = above
        extra = extra[:, :labels]
        extra.sort(axis=2)
        cost = self._problem.count[self._rows[:, None], counts[:, :, None] + np.arange(zones + 1)]
        cost[:, :, 1:] += np.add.accumulate(extra, 2)
        total: Floats = np.add.reduce(np.minimum.reduce(cost, 2), 1)
        return total


def _reachable(count: Floats) -> Floats:
    """(R + 1, L, R + 1): the least cost of a label's count n when as many zones as the first index are to come."""
    out = np.empty((count.shape[1], *count.shape))
    out[0] = count
    for to_come in range(1, len(out)):
        out[to_come] = out[to_come - 1]
        np.minimum(out[to_come, :, :-1], out[to_come - 1, :, 1:], out=out[to_come, :, :-1])
    return out
