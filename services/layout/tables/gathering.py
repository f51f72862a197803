"""A table as one zone: cells are not zones of the layout graph, so rows do not change what a page looks like to it."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from statistics import median

import numpy as np

from services.layout.page import Box, Page, Zone, ZoneWord
from services.layout.segmentation import FinePage, compose_page
from services.layout.tables.finding import find_tables
from services.layout.tables.found_table import FoundTable
from services.layout.tables.item_table import OF_TABLE
from services.layout.tables.print_rows import box_of, printed_rows
from services.layout.tables.table_model import TableModel

_Key = tuple[str, Box]


def best_tables(
    page: Page, models: Sequence[TableModel], before: Sequence[FoundTable] = ()
) -> tuple[FoundTable, ...]:
    """The tables of a page by the model that they fit best; `before` are those of the page before."""
    last = before[-1] if before else None
    found = [find_tables(page, model, last) for model in models]
    return max(found, key=lambda tables: sum(table.score for table in tables), default=())


def gather_lines(fine: FinePage, tables: Sequence[FoundTable]) -> FinePage:
    """The page with each table as one zone, apart from its lines of text, which no later step then cuts or joins."""
    if not tables:
        return fine
    page = compose_page(fine)
    zones = [table_zone(page, table, f"table{k}") for k, table in enumerate(tables, 1)]
    held = _keys(tables)
    boxes = [zone.box for zone in zones]
    dropped = {
        k
        for k, words in enumerate(fine.words)
        if (
            all(_key(word.text, word.box) in held for word in words)
            if words
            else _is_within(fine.boxes[k], boxes)
        )
    }
    others = [zone for zone in fine.others if not _is_part(zone, held, boxes)]
    loose = tuple(word for word in fine.loose if _key(word.text, word.box) not in held)
    return replace(_without_lines(fine, dropped), others=(*others, *zones), loose=loose)


def gather_zones(page: Page, tables: Sequence[FoundTable], kept: Set[str] = frozenset()) -> Page:
    """The page with each table as one zone, the last ones, without a label.

    Zones lose their words that are in a table, and are dropped where none is left. Zones with a label of `kept` stay.
    """
    if not tables:
        return page
    held = _keys(tables)
    tables_zones = [table_zone(page, table, f"table{k}") for k, table in enumerate(tables, 1)]
    boxes = [zone.box for zone in tables_zones]
    zones = []
    for zone in page.zones:
        if zone.label in kept and zone.label is not None:
            zones.append(zone)
        elif not _is_part(zone, held, boxes):
            zones.append(_left_of(zone, held))
    loose = tuple(word for word in page.loose if _key(word.text, word.box) not in held)
    return replace(page, zones=(*zones, *tables_zones), loose=loose)


def table_zone(page: Page, table: FoundTable, id: str) -> Zone:
    """A table as a zone; what is measured of its print is that of the zones of `page` that it covers."""
    rows = printed_rows(table.words)
    words = tuple(replace(word, line=k) for k, row in enumerate(rows) for word in row.words)
    held = _keys([table])
    under = [
        zone
        for zone in page.zones
        if zone.kind == "text" and any(_key(word.text, word.box) in held for word in zone.words)
    ]
    return Zone(
        id=id,
        box=table.box,
        lines=len(rows),
        font_size=_middle([zone.font_size for zone in under]),
        line_spacing=_middle([zone.line_spacing for zone in under]),
        weight=_middle([zone.weight for zone in under]),
        text="\n".join(" ".join(word.text for word in row.words) for row in rows),
        words=words,
    )


def _middle(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return median(known) if known else None


def _key(text: str, box: Sequence[float]) -> _Key:
    """A word by its text and its place; stored boxes are whole pixels."""
    x0, y0, x1, y1 = (float(round(value)) for value in box)
    return text, (x0, y0, x1, y1)


def _keys(tables: Sequence[FoundTable]) -> set[_Key]:
    return {_key(word.text, word.box) for table in tables for word in table.words}


def _is_part(zone: Zone, held: Set[_Key], boxes: Sequence[Box]) -> bool:
    """Whether a zone has nothing but words of tables, or none and lies in one."""
    if zone.words:
        return all(_key(word.text, word.box) in held for word in zone.words)
    return _is_within(zone.box, boxes)


def _is_within(box: Sequence[float] | np.ndarray, boxes: Sequence[Box]) -> bool:
    x0, y0, x1, y1 = (float(value) for value in box)
    area = max(1.0, x1 - x0) * max(1.0, y1 - y0)
    # A rule is a little wider than the print that it parts.
    for a0, b0, a1, b1 in boxes:
        pad = 0.02 * (a1 - a0)
        across = min(x1, a1 + pad) - max(x0, a0 - pad)
        down = min(y1, b1 + pad) - max(y0, b0 - pad)
        if max(0.0, across) * max(0.0, down) >= OF_TABLE * area:
            return True
    return False


def _left_of(zone: Zone, held: Set[_Key]) -> Zone:
    """The zone without its words that are in a table; the same where it has none of them."""
    words = [word for word in zone.words if _key(word.text, word.box) not in held]
    if len(words) == len(zone.words):
        return zone
    lines: Mapping[int, list[ZoneWord]] = {row: [] for row in dict.fromkeys(word.line for word in words)}
    for word in words:
        lines[word.line].append(word)
    numbered = tuple(replace(word, line=k) for k, own in enumerate(lines.values()) for word in own)
    text = "\n".join(" ".join(word.text for word in own) for own in lines.values())
    return replace(
        zone, box=box_of(words), lines=len(lines), text=text, words=numbered, content={}, pieces=()
    )


def _without_lines(fine: FinePage, dropped: Set[int]) -> FinePage:
    kept = [k for k in range(len(fine.lines)) if k not in dropped]
    place = {old: new for new, old in enumerate(kept)}
    blocks = (tuple(place[line] for line in block if line in place) for block in fine.blocks)
    return replace(
        fine,
        lines=tuple(fine.lines[k] for k in kept),
        boxes=fine.boxes[kept].reshape(-1, 4),
        texts=tuple(fine.texts[k] for k in kept),
        words=tuple(fine.words[k] for k in kept),
        begins=frozenset(place[line] for line in fine.begins if line in place),
        blocks=tuple(block for block in blocks if block),
    )
