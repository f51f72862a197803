"""The tables of a result as a person has corrected them, by the cells that he labelled on the page.

A cell takes the place of what was found in it. Another zone that was drawn there takes it away: a sum is no item. So
does another label of the zone that the table lies in, and this zone left out with nothing drawn in its place.
"""

from collections.abc import Sequence, Set
from dataclasses import dataclass, field
from typing import cast

from services.contract.boxes import CELL_IN_ROW, are_one_place, common_height, holds_middle, lie_on_each_other
from services.contract.fields import FieldSetting
from services.contract.layout_learning import Correction
from services.contract.result_json import CellJson, FoundCellJson, LabelledZoneJson, ResultJson, TableJson
from services.layout.values.typed_value import find_value, plain_text

Box = Sequence[float]
Row = dict[str, CellJson]


@dataclass(slots=True)
class _Table:
    """A table whose rows are changed: cells by their columns. `given` are the cells of the person, by identity."""

    found: TableJson
    rows: list[Row] = field(default_factory=list)
    given: set[int] = field(default_factory=set)

    @classmethod
    def of(cls, found: TableJson) -> "_Table":
        rows = [
            {label: cell for label, cell in zip(found["columns"], row, strict=True) if cell is not None}
            for row in found["rows"]
        ]
        return cls(found, rows)


def correct_tables(
    found: ResultJson, zones: Sequence[LabelledZoneJson], correction: Correction
) -> tuple[list[TableJson], Set[str]]:
    """The `tables` of a result with the cells among its verified `zones`, and the labels of cells.

    Where the cells are in none of the found tables, or the class is another one, the tables are those that its model
    finds after learning (`correction.tables`).
    """
    name, before = correction.class_name, found.get("tables", [])
    if name is None:
        return [], frozenset()
    is_found = found["class"] is not None and name == found["class"]["name"]
    again = correction.tables
    tables = before if is_found else again or []
    columns = frozenset(
        (*correction.items, *(label for table in (*tables, *(again or ())) for label in table["columns"]))
    )
    cells = [zone for zone in zones if zone["label"] in columns]
    # Of another class labels are not compared: its model has given those that the person has not.
    taking = [
        zone
        for zone in zones
        if zone["label"] not in columns and not _is_as_found(zone, found["zones"], any_label=not is_found)
    ]
    if again and not _hold(tables, cells) and _hold(again, cells):
        tables = again
    changed = [_Table.of(table) for table in tables]
    for zone in taking:
        _take_away(changed, zone["box"], is_row=zone["label"] is None)
    for box in _left_out(found["zones"], zones):
        _take_away(changed, box)
    for cell in sorted(cells, key=lambda each: each["box"][1]):
        _put(changed, cell, correction)
    shown = [_shown(each, correction) for each in changed]
    return [table for table in shown if table["rows"]], columns


def _is_as_found(zone: LabelledZoneJson, found: Sequence[LabelledZoneJson], *, any_label: bool) -> bool:
    """Whether a zone is one that was found, and but for `any_label` with no label that it did not have then."""
    return any(
        are_one_place(zone["box"], each["box"]) and (any_label or zone["label"] in (None, each["label"]))
        for each in found
    )


def _left_out(found: Sequence[LabelledZoneJson], zones: Sequence[LabelledZoneJson]) -> list[Box]:
    """The boxes of the found zones in whose place a person has drawn nothing."""
    drawn = [zone["box"] for zone in zones]
    return [each["box"] for each in found if not any(lie_on_each_other(each["box"], box) for box in drawn)]


def _hold(tables: Sequence[TableJson], cells: Sequence[LabelledZoneJson]) -> bool:
    """Whether the tables have a cell of the same column in each of these, and so the rows around them."""
    return all(
        any(cell is not None and label == zone["label"] and holds_middle(zone["box"], cell["box"])
            for table in tables for row in table["rows"] for label, cell in zip(table["columns"], row, strict=True))
        for zone in cells
    )  # fmt: skip


def _take_away(tables: Sequence[_Table], box: Box, *, is_row: bool = False) -> None:
    """Remove the cells in a box; with `is_row` only where they are of one row."""
    inside = [
        (row, [label for label, cell in row.items() if holds_middle(box, cell["box"])])
        for table in tables
        for row in table.rows
    ]
    inside = [(row, labels) for row, labels in inside if labels]
    if is_row and len(inside) != 1:
        return
    for row, labels in inside:
        for label in labels:
            del row[label]


def _put(tables: list[_Table], zone: LabelledZoneJson, correction: Correction) -> None:
    """Put a labelled cell in its row: the one most at its height that has none of his in the column, or a new one."""
    label, box, cell = cast(str, zone["label"]), zone["box"], _cell(zone, correction)
    rows = [(common_height(box, _hull(row)), table, row) for table in tables for row in table.rows if row]
    for _, table, row in rows:
        for other in [other for other, each in row.items() if id(each) not in table.given]:
            if holds_middle(box, row[other]["box"]) or (
                other == label and holds_middle(row[other]["box"], box)
            ):
                replaced = row.pop(other)
                if replaced["text"] != cell["text"]:
                    cell["found"] = FoundCellJson(text=replaced["text"], confidence=replaced["confidence"])
    near = [each for each in rows if each[0] > CELL_IN_ROW and id(each[2].get(label)) not in each[1].given]
    if near:
        _, table, row = max(near, key=lambda each: each[0])
    else:
        if not tables:
            empty = TableJson(columns=[], types=[], headers=[], box=list(box), rows=[], checks={})
            tables.append(_Table(empty))
        table, row = min(tables, key=lambda each: _distance(box, each.found["box"])), {}
        table.rows.append(row)
    if (beside := row.get(label)) is not None and beside["text"] != cell["text"]:
        cell["found"] = FoundCellJson(text=beside["text"], confidence=beside["confidence"])
    row[label] = cell
    table.given.add(id(cell))


def _cell(zone: LabelledZoneJson, correction: Correction) -> CellJson:
    value = find_value(plain_text(zone["text"]), correction.fields.get(str(zone["label"]), FieldSetting()))
    sure = zone.get("text_confidence")
    return CellJson(
        box=zone["box"],
        text=zone["text"],
        value=value.value,
        currency=value.currency,
        problem=value.problem,
        confidence=1.0 if sure is None else sure,
    )


def _shown(table: _Table, correction: Correction) -> TableJson:
    """The answer of a table; the same one where nothing is changed, else without what its numbers said."""
    found = table.found
    if _Table.of(found).rows == table.rows:
        return found
    order = dict.fromkeys((*correction.items, *found["columns"]))
    columns = [label for label in order if any(label in row for row in table.rows)]
    headers = dict(zip(found["columns"], found["headers"], strict=True))
    rows = sorted((row for row in table.rows if row), key=lambda row: _hull(row)[1])
    return TableJson(
        columns=columns,
        types=[correction.fields.get(label, FieldSetting()).type for label in columns],
        headers=[headers.get(label) for label in columns],
        box=_hull_of([found["box"], *map(_hull, rows)]),
        rows=[[row.get(label) for label in columns] for row in rows],
        checks={"products": None, "unlike_rows": [], "sum": None},
    )


def _hull(row: Row) -> list[float]:
    return _hull_of([cell["box"] for cell in row.values()])


def _hull_of(boxes: Sequence[Box]) -> list[float]:
    x0, y0, x1, y1 = zip(*boxes, strict=True)
    return [min(x0), min(y0), max(x1), max(y1)]


def _distance(box: Box, other: Box) -> float:
    """From top to bottom; negative where they overlap."""
    return max(box[1] - other[3], other[1] - box[3])
