"""The page, and its recognition, whose zones are groups of another page's zones."""

from collections.abc import Sequence
from dataclasses import replace

from services.layout.grouping.joining import Groups
from services.layout.grouping.piece_pairs import joined_box
from services.layout.page import Page, Zone
from services.layout.recognition.results import Recognition, RecognizedZone
from services.layout.segmentation import FinePage, text_zone, with_appearance
from services.layout.segmentation.measures import order_by_rows
from services.layout.segmentation.reading_order import reading_order


def join_page(
    fine: FinePage, page: Page, lines: Sequence[Sequence[int]], groups: Groups
) -> tuple[Page, Groups]:
    """`page` with one zone for each of `groups`, measured anew from its lines, in reading order, ids "z1", "z2" ...

    `lines` has for each zone of `page` its lines in `fine`. The groups come back in the order of their zones.
    """
    zones = [
        _join(fine, [page.zones[place] for place in group], [lines[place] for place in group])
        for group in groups
    ]
    numbered, order = number_zones(replace(page, zones=tuple(zones)))
    return numbered, tuple(groups[place] for place in order)


def number_zones(page: Page) -> tuple[Page, list[int]]:
    """`page` with its zones in reading order, ids "z1", "z2" ..., and their places before."""
    order = reading_order([zone.box for zone in page.zones])
    numbered = tuple(replace(page.zones[place], id=f"z{number}") for number, place in enumerate(order, 1))
    return replace(page, zones=numbered), order


def join_recognition(seen: Recognition, page: Page, groups: Groups) -> Recognition:
    """The recognition of a page for the `page` that `join_page` has made of it.

    A zone has the label of its pieces, and the least of their confidences and of their evidence; of several pieces no
    other labels are told. The match stays that of the pieces; its zones have their new ids.
    """
    zones = tuple(
        RecognizedZone(
            zone,
            seen.zones[group[0]].label,
            min(seen.zones[place].confidence for place in group),
            seen.zones[group[0]].group,
            order,
            min(
                (each for each in (seen.zones[place].evidence for place in group) if each is not None),
                default=None,
            ),
            seen.zones[group[0]].others if len(group) == 1 else {},
            max(seen.zones[place].several or 0.0 for place in group)
            if len(group) > 1
            else seen.zones[group[0]].several,
            seen.zones[group[0]].shares if len(group) == 1 else {},
        )
        for order, (zone, group) in enumerate(zip(page.zones, groups, strict=True))
    )
    new_id = {
        seen.zones[place].zone.id: zone.id
        for zone, group in zip(page.zones, groups, strict=True)
        for place in group
    }
    match = seen.match
    if match is not None:
        match = replace(
            match,
            backbone={label: new_id[zone] for label, zone in match.backbone.items()},
            explanation=tuple(
                replace(
                    term, zone=new_id[term.zone], other=None if term.other is None else new_id[term.other]
                )
                for term in match.explanation
            ),
        )
    return replace(seen, page=page, zones=zones, match=match)


def in_pieces(page: Page) -> Page:
    """The page before its pieces were put together: for each piece a zone, as far as its box tells what it was like."""
    if not any(zone.pieces for zone in page.zones):
        return page
    return replace(page, zones=tuple(piece for zone in page.zones for piece in _divide(zone)))


def _divide(zone: Zone) -> list[Zone]:
    if not zone.pieces:
        return [zone]
    heights = [box[3] - box[1] for box in zone.pieces]
    return [
        replace(
            zone,
            id=f"{zone.id}.{number}",
            box=box,
            lines=zone.lines and max(1, round(zone.lines * height / sum(heights))),
            pieces=(),
        )
        for number, (box, height) in enumerate(zip(zone.pieces, heights, strict=True), 1)
    ]


def _join(fine: FinePage, pieces: Sequence[Zone], lines: Sequence[Sequence[int]]) -> Zone:
    if len(pieces) == 1:
        return pieces[0]
    box = pieces[0].box
    boxes = tuple(each for piece in pieces for each in piece.pieces or (piece.box,))
    for piece in pieces[1:]:
        box = joined_box(box, piece.box)
    found = [line for own in lines for line in own]
    if not found:
        joined = replace(pieces[0], box=box, kind="figure", pieces=boxes)
    else:
        order = order_by_rows([fine.lines[line] for line in found], fine.boxes[found, 0].tolist())
        joined = replace(text_zone(fine, [found[place] for place in order]), box=box, pieces=boxes)
    return with_appearance(fine.ink, [joined])[0]
