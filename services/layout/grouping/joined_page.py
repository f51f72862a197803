"""The page whose zones are groups of another page's zones."""

from collections.abc import Sequence
from dataclasses import replace

from services.layout.grouping.joining import Groups
from services.layout.grouping.piece_pairs import joined_box
from services.layout.page import Page, Zone
from services.layout.segmentation import FinePage, text_zone
from services.layout.segmentation.reading_order import reading_order


def join_page(fine: FinePage, page: Page, lines: Sequence[Sequence[int]], groups: Groups) -> Page:
    """`page` with one zone for each of `groups`, measured anew from its lines, in reading order, ids "z1", "z2" ...

    `lines` has for each zone of `page` its lines in `fine`.
    """
    zones = [
        _join(fine, [page.zones[place] for place in group], [lines[place] for place in group])
        for group in groups
    ]
    order = reading_order([zone.box for zone in zones])
    numbered = (replace(zones[place], id=f"z{number}") for number, place in enumerate(order, 1))
    return replace(page, zones=tuple(numbered))


def _join(fine: FinePage, pieces: Sequence[Zone], lines: Sequence[Sequence[int]]) -> Zone:
    if len(pieces) == 1:
        return pieces[0]
    box = pieces[0].box
    for piece in pieces[1:]:
        box = joined_box(box, piece.box)
    rows = sorted(
        (line for own in lines for line in own),
        key=lambda line: (fine.lines[line].baseline, fine.boxes[line, 0]),
    )
    if not rows:
        return replace(pieces[0], box=box, kind="figure")
    return replace(text_zone(fine, rows), box=box)
