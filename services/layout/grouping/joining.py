"""Zones of a recognized page put together where their labels and places say that they are pieces of one zone (5.4)."""

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from services.layout.grouping.piece_pairs import (
    MOST_ZONES,
    joined_box,
    neighbours_of,
    piece_probability,
    print_size,
)
from services.layout.page import Page, Zone
from services.layout.recognition.results import LabelledZone


@dataclass(frozen=True, slots=True)
class JoiningParameters:
    """Measured on real letters and title pages."""

    least_probability: float = 0.77
    """Of a join: that both labels are right, and that both zones are pieces of one. A wrong join hides a right zone, a
    missing one leaves its pieces with their label, so that doubtful pieces stay apart."""
    most_zones: int = MOST_ZONES
    """Pages of more zones stay as they are."""


Groups = tuple[tuple[int, ...], ...]
"""Places of the zones of a page that become one zone, in the order of the page; a zone alone is a group, too."""


def find_groups(
    zones: Sequence[LabelledZone],
    page: Page,
    joining: Mapping[str, float],
    parameters: JoiningParameters = JoiningParameters(),
) -> Groups:
    """Groups of zones that are pieces of one: the most probable pair first, until none is probable enough.

    `joining` are the log odds that the class has learned for its labels.
    """
    count = len(zones)
    if count > parameters.most_zones:
        return tuple((place,) for place in range(count))
    em = print_size(page)
    pieces: list[Zone | None] = [replace(each.zone, label=each.label) for each in zones]
    sure = [each.confidence for each in zones]
    members = [[place] for place in range(count)]
    queue: list[tuple[float, int, int]] = []

    def offer(place: int, others: Sequence[int]) -> None:
        own = pieces[place]
        for other in others:
            zone = pieces[other]
            if own is None or zone is None or other == place:
                continue
            probability = piece_probability(own, zone, em, joining) * sure[place] * sure[other]
            if probability >= parameters.least_probability:
                heapq.heappush(queue, (-probability, other, place))

    for place in range(count):
        offer(place, [other for other in neighbours_of(place, pieces, em) if other < place])
    while queue:
        _, a, b = heapq.heappop(queue)
        first, second = pieces[a], pieces[b]
        if first is None or second is None:
            continue
        pieces[a] = pieces[b] = None
        pieces.append(_joined(first, second))
        sure.append(min(sure[a], sure[b]))
        members.append(members[a] + members[b])
        offer(len(pieces) - 1, neighbours_of(len(pieces) - 1, pieces, em))
    kept = [members[place] for place, piece in enumerate(pieces) if piece is not None]
    return tuple(sorted(tuple(sorted(group)) for group in kept))


def _joined(first: Zone, second: Zone) -> Zone:
    """A zone of two pieces, with the print of the one that has more lines; enough to find more pieces of it."""
    larger = first if (first.lines or 0) >= (second.lines or 0) else second
    lines = (first.lines or 0) + (second.lines or 0)
    return replace(
        larger,
        box=joined_box(first.box, second.box),
        kind="text" if "text" in (first.kind, second.kind) else larger.kind,
        lines=lines or None,
    )
