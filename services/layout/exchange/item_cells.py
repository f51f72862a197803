"""Which zones a table of items covers: files show the table in their place."""

from collections.abc import Sequence

from services.contract.boxes import area, common_area
from services.layout.page import Box
from services.layout.recognition.results import RecognizedZone
from services.layout.tables.item_table import OF_TABLE, ItemTable

_WHOLE = 0.9
"""Share of a table that a zone covers from which on it is the table."""


def table_around(box: Box, tables: Sequence[ItemTable]) -> ItemTable | None:
    """The table that a zone with this box is a part of."""
    return next((table for table in tables if _share(box, table.box) >= OF_TABLE), None)


def table_of_zone(box: Box, tables: Sequence[ItemTable]) -> ItemTable | None:
    """The table that a zone with this box is."""
    around = table_around(box, tables)
    return around if around is not None and _share(around.box, box) >= _WHOLE else None


def outside_cells(zones: Sequence[RecognizedZone], tables: Sequence[ItemTable]) -> list[RecognizedZone]:
    """The zones that are no cells of a table: those that a person drew stand in the table already."""
    return [each for each in zones if not _is_cell(each, tables)]


def _is_cell(zone: RecognizedZone, tables: Sequence[ItemTable]) -> bool:
    around = table_around(zone.zone.box, tables)
    is_table = table_of_zone(zone.zone.box, tables) is not None
    return around is not None and not is_table and zone.label in around.columns


def _share(box: Box, other: Box) -> float:
    """Of a box, how much of it lies in the other one."""
    return common_area(box, other) / max(1.0, area(box))
