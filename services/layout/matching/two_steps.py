"""The dissertation's matching (5.4): the best one-to-one mapping, then grouping of the other zones with it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from services.layout.matching.cost_tables import CostTables, Matching
from services.layout.matching.direct import match_directly
from services.layout.matching.labelling import Floats, Labelling, Labels, Neighbours
from services.layout.matching.parameters import LEAST_GAIN, MatchingParameters

_LEFT_OVER = 0.05
"""Of one and of what a label gains over null: the cost of being grouped later. The zone that a label fits best is the
backbone's then, and the others of its group are left over."""


@dataclass(frozen=True, slots=True, eq=False)
class TwoStepMatching:
    """The final labelling, and the (label, zone) pairs of the first step in the order of labels.

    `optimal` and `lower_bound` of the matching are of all labellings, grouped or not; `explored` is of both steps.
    """

    matching: Matching
    backbone: tuple[tuple[int, int], ...]


def match_in_two_steps(tables: CostTables, boxes: Floats, parameters: MatchingParameters) -> TwoStepMatching:
    """Match one to one, then group the zones left to matched model nodes as long as the cost falls.

    `boxes` (N, 4), (x0, y0, x1, y1), are needed for `parameters.manhattan`: a zone may then join a group only if the
    box around both overlaps no zone of another group, and the zone no such box.
    """
    if tables.zones == 0 or tables.labels == 1:
        return TwoStepMatching(match_directly(tables, parameters), ())
    first = match_directly(_one_to_one(tables), parameters)
    labels = _without_doubles(tables, first.labels)
    backbone = tuple((int(labels[zone]), int(zone)) for zone in np.flatnonzero(labels))
    labels = _group(tables, np.asarray(boxes, float), labels, parameters.manhattan)
    cost = tables.cost(labels)
    bound = match_directly(tables, replace(parameters, max_nodes=0, max_sweeps=min(2, parameters.max_sweeps)))
    lower = min(bound.lower_bound, cost)
    optimal = bound.optimal and cost - lower <= 1e-9 * (1.0 + abs(cost))
    return TwoStepMatching(Matching(labels, cost, lower, optimal, first.explored), tuple(sorted(backbone)))


def _one_to_one(tables: CostTables) -> CostTables:
    """The same costs, but a second zone of a model node costs more than all that labels can gain.

    What is left over will be grouped, so it is charged what its best label would cost: else the other paragraphs of a
    page take the nodes of rare components, each cheaper than null, and the second step takes none back.
    """
    ranges = np.ptp(tables.node, axis=1).sum() + np.ptp(tables.count, axis=1).sum()
    if len(tables.edge):
        ranges += np.ptp(tables.edge, axis=(1, 2)).sum()
    count = tables.count.copy()
    more = np.arange(2, count.shape[1])
    count[1:, 2:] = count[1:, 1:2] + (1.0 + ranges) * (more - 1)
    count[0] = count[0].min()
    node = tables.node.copy()
    best = node[:, 1:].min(axis=1)
    node[:, 0] = np.minimum(node[:, 0], best + _LEFT_OVER * (1.0 + node[:, 0] - best))
    return replace(tables, node=node, count=count)


def _without_doubles(tables: CostTables, labels: Labels) -> Labels:
    """One-to-one where a search without any budget was stopped short of it: the cheaper zone keeps its label."""
    labels = labels.copy()
    rank = tables.node[np.arange(tables.zones), labels]
    for label in np.flatnonzero(np.bincount(labels) > 1):
        if label:
            zones = np.flatnonzero(labels == label)
            labels[zones[zones != zones[rank[zones].argmin()]]] = 0
    return labels


def _group(tables: CostTables, boxes: Floats, labels: Labels, manhattan: bool) -> Labels:
    """The zones of null join the groups of the labels in use, the greatest gain first."""
    state = Labelling(tables, Neighbours(tables), labels)
    least_gain = LEAST_GAIN * (1.0 + abs(tables.cost(labels)))
    used = np.unique(labels[labels > 0])
    blocked = np.ones((tables.zones, tables.labels), bool)
    for label in used:
        blocked[:, label] = _blocked(boxes, state.labels, int(label)) if manhattan else False
    for _ in range(tables.zones):
        changes = np.where(blocked, np.inf, state.changes())
        changes[state.labels > 0] = np.inf
        zone, label = divmod(int(changes.argmin()), tables.labels)
        if changes[zone, label] > -least_gain:
            break
        state.change(zone, label)
        if manhattan:
            # the group has grown: zones inside its box join no other, and others grow around the new zone in vain
            blocked[:, label] |= _blocked(boxes, state.labels, label)
            inside = _overlap(boxes, _grown(boxes, state.labels, label)[zone])
            for other in used[used != label]:
                blocked[:, other] |= inside | _overlap(_grown(boxes, state.labels, int(other)), boxes[zone])
    return state.labels


def _grown(boxes: Floats, labels: Labels, label: int) -> Floats:
    """(N, 4): the box around the zones of a label and each zone."""
    group = boxes[labels == label]
    return np.hstack(
        [np.minimum(boxes[:, :2], group[:, :2].min(0)), np.maximum(boxes[:, 2:], group[:, 2:].max(0))]
    )


def _overlap(boxes: Floats, box: Floats) -> NDArray[np.bool_]:
    """Whether boxes (..., 4) share an area with `box` (4,), or with those that it broadcasts to."""
    lower = np.maximum(boxes[..., :2], box[..., :2])
    upper = np.minimum(boxes[..., 2:], box[..., 2:])
    shared: NDArray[np.bool_] = np.all(lower < upper, axis=-1)
    return shared


def _blocked(boxes: Floats, labels: Labels, label: int) -> NDArray[np.bool_]:
    """(N,): whether a zone cannot join the group of a label, as its box would then overlap another group's zone."""
    others = boxes[(labels > 0) & (labels != label)]
    blocked: NDArray[np.bool_] = np.any(_overlap(_grown(boxes, labels, label)[:, None], others[None]), axis=1)
    return blocked
