"""Which zones keep or get a label of parts of lines, by what samples have of all its zones on a page.

A label that they have once a page is of the surest zone. Zones of the others lie together, with no line between them
that may be one of theirs.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.special import expit

from services.layout.graph.edge_attributes import RELATIONS, measure_pairs
from services.layout.graph.node_attributes import describe_zones
from services.layout.grouping.line_parts import labels_of_parts, same_value, single_parts
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Box, Page
from services.layout.recognition.label_evidence import MOST_AWAY
from services.layout.recognition.results import Recognition, RecognizedZone

_GAP = next(relation for relation in RELATIONS if relation.name == "gap-along")
_NEVER = 1.6
"""Cost of a gap between two zones of a label that eight pairs of the samples never have: log((8 + 2) / 2)."""

Groups = tuple[tuple[int, ...], ...]


def with_zones_of_labels(seen: Recognition, model: LayoutModel) -> Recognition:
    """The recognition with the labels of parts where samples have them together."""
    return with_lines_between(with_near_zones(with_single_zones(seen, model), model), model)


def with_single_zones(seen: Recognition, model: LayoutModel) -> Recognition:
    """The recognition; of zones with a label that samples have once a page, the surest keeps it.

    This is for labels of parts: a column of amounts holds several that look like the total.
    """
    single = single_parts(model)
    best: dict[str, RecognizedZone] = {}
    for each in seen.zones:
        if each.label in single:
            assert each.label is not None
            best[each.label] = max(best.get(each.label, each), each, key=_evidence)
    zones = tuple(
        _without_label(each) if each.label in best and best[each.label] is not each else each
        for each in seen.zones
    )
    return replace(seen, zones=zones)


def with_near_zones(seen: Recognition, model: LayoutModel) -> Recognition:
    """The recognition; of zones with a label that are farther apart than on any sample, the surest together keep it.

    This is for labels of parts: a receipt has the address of its shop, and perhaps one of a customer.
    """
    costs = {edge.upper: edge.costs for edge in model.edges if edge.upper == edge.lower}
    left: dict[int, RecognizedZone] = {}
    for label in labels_of_parts(model):
        gaps = costs.get(label, {}).get(_GAP.name)
        places = [place for place, each in enumerate(seen.zones) if each.label == label]
        if gaps is None or len(places) < 2:
            continue
        together = _near(seen.page, places, _up_to_widest(np.array(gaps) < _NEVER))
        best = max(together, key=lambda group: sum(seen.zones[place].confidence for place in group))
        left |= {place: _without_label(seen.zones[place]) for place in places if place not in best}
    if not left:
        return seen
    return replace(seen, zones=tuple(left.get(place, each) for place, each in enumerate(seen.zones)))


def with_lines_between(seen: Recognition, model: LayoutModel) -> Recognition:
    """The recognition; a zone between two with a label has it too, if its own one is hardly more probable.

    This is for labels of parts of which a page has several: lines of an address. A line between two of them is a
    street or a place, seldom a number of another kind, and those are less probable by far.
    """
    zones = list(seen.zones)
    for label in sorted(labels_of_parts(model) - single_parts(model)):
        boxes = [each.zone.box for each in zones if each.label == label]
        for place, each in enumerate(zones):
            odds = _log_odds(each, label)
            if each.label is None and odds > -MOST_AWAY and _is_between(each.zone.box, boxes):
                zones[place] = _with_label(each, label, odds)
    return replace(seen, zones=tuple(zones))


def without_equal_values(groups: Groups, zones: Sequence[RecognizedZone], model: LayoutModel) -> Groups:
    """The groups of zones to be joined; a value that is printed twice, and that samples have once, is not joined."""
    single = single_parts(model)
    parted = (
        tuple((place,) for place in group)
        if len(group) > 1
        and zones[group[0]].label in single
        and same_value(zones[place].zone.text for place in group)
        else (group,)
        for group in groups
    )
    return tuple(sorted((part for parts in parted for part in parts), key=min))


def _up_to_widest(may_be: np.ndarray) -> np.ndarray:
    """Which classes of gaps, in ascending order, are no wider than the widest one that `may_be`."""
    return np.maximum.accumulate(may_be[::-1])[::-1]


def _near(page: Page, places: Sequence[int], may_be: np.ndarray) -> list[set[int]]:
    """The zones at `places` in groups, each zone of which has another one at a gap that `may_be` (classes of gaps)."""
    upper, lower = np.array(list(combinations(places, 2))).T
    measures = describe_zones(page)
    gaps = _GAP.measure(measure_pairs(measures, np.stack([upper, lower], axis=1)))
    groups = [{place} for place in places]
    for a, b in zip(upper[may_be[gaps]].tolist(), lower[may_be[gaps]].tolist(), strict=True):
        joined = [group for group in groups if a in group or b in group]
        groups = [group for group in groups if group not in joined] + [set().union(*joined)]
    return groups


def _is_between(box: Box, others: Sequence[Box]) -> bool:
    """Whether one of the others is above a box and one below it, both in its column."""
    column = [each for each in others if min(each[2], box[2]) > max(each[0], box[0])]
    middles = [(each[1] + each[3]) / 2 for each in column]
    return any(middle < box[1] for middle in middles) and any(middle > box[3] for middle in middles)


def _log_odds(each: RecognizedZone, label: str) -> float:
    """Of the label against the zone's own one; minus infinity where it is not probable, or where nothing was read."""
    share = (1.0 - each.confidence) * each.others.get(label, 0.0)
    if not share or not each.zone.text.strip():
        return -np.inf
    return float(np.log(share) - np.log(max(each.confidence, 1e-9)))


def _with_label(each: RecognizedZone, label: str, odds: float) -> RecognizedZone:
    """The zone with a label that has these log odds against its own one."""
    others = {name: share for name, share in each.others.items() if name != label}
    evidence = None if each.evidence is None else odds
    return replace(
        each, label=label, group=label, confidence=float(expit(odds)), evidence=evidence, others=others
    )


def _without_label(each: RecognizedZone) -> RecognizedZone:
    assert each.label is not None, "only zones with a label lose it"
    others = {each.label: each.confidence}
    return replace(each, label=None, group=None, confidence=1.0 - each.confidence, others=others)


def _evidence(zone: RecognizedZone) -> float:
    return zone.confidence if zone.evidence is None else zone.evidence
