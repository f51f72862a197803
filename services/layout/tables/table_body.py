"""The body of a table: which rows are items, which belong to the item above or below, and where the table ends."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from services.layout.tables.column_evidence import Assignment, kind_evidence
from services.layout.tables.row_cells import PageRows, RowCells
from services.layout.tables.table_model import TableModel
from services.layout.values.kinds import NUMERIC

MOST_ITEMS = 300
"""Of a table on one page."""
_ALIEN = -2.0
"""Log odds of a row with print between the columns."""


@dataclass(frozen=True, slots=True, eq=False)
class TableBody:
    """Items, each with log odds of being one, and the rows of text that belong to them."""

    items: tuple[tuple[RowCells, float], ...]
    loose: tuple[RowCells, ...]


def find_body(
    page: PageRows, model: TableModel, lines: Sequence[RowCells], assignment: Assignment
) -> TableBody:
    """Items and the rows between them, from the first item to where the table ends."""
    label_of = {place: label for label, place in assignment.places.items() if place is not None}
    known = {column.label: column for column in model.columns}
    items: list[tuple[RowCells, float]] = []
    loose: list[RowCells] = []
    kept: list[RowCells] = []
    for line in lines:
        kinds = line.kinds()
        odds = _ALIEN if line.alien else 0.0
        for place, label in label_of.items():
            column = known[label]
            share = (column.cells + 0.5) / (max(column.rows, column.cells) + 1.0)
            odds += (
                kind_evidence(column, kinds[place]) if place in kinds else np.log(2.0 * (1.0 - share) + 0.02)
            )
        number = any(kinds.get(place) in NUMERIC for place in label_of)
        if odds > 0 and (number or not _has_numbers(model)):
            items.append((line, float(odds)))
            kept += loose
            loose = []
            if len(items) >= MOST_ITEMS:
                break
        elif _is_text_only(model, line, kinds, label_of):
            loose.append(line)
        elif items:
            break
        else:
            loose = []
    trailing = _close(page, items[-1][0] if items else None, loose, kept)
    return TableBody(tuple(items), (*kept, *trailing))


def _has_numbers(model: TableModel) -> bool:
    return any(
        column.kinds.get(kind, 0.0) > 0.5 * column.cells for column in model.columns for kind in NUMERIC
    )


def _is_text_only(
    model: TableModel, line: RowCells, kinds: Mapping[int, str], label_of: Mapping[int, str]
) -> bool:
    """Whether a row only has text in columns of text: the rest of a description."""
    known = {column.label: column for column in model.columns}
    for place in line.cells:
        label = label_of.get(place)
        if label is None or _is_numeric(known[label].kinds):
            return False
    return not line.alien and bool(line.cells)


def _close(
    page: PageRows, last: RowCells | None, loose: Sequence[RowCells], kept: Sequence[RowCells]
) -> tuple[RowCells, ...]:
    """Of rows of text below the last item those that are as near as lines of one item are."""
    if last is None:
        return ()
    near = 1.25 * _usual_step(page, kept) if kept else 1.4 * page.em
    found = []
    middle = page.rows[last.place].middle
    for line in loose:
        if page.rows[line.place].middle - middle > near:
            break
        middle = page.rows[line.place].middle
        found.append(line)
    return tuple(found)


def _usual_step(page: PageRows, lines: Sequence[RowCells]) -> float:
    """Of each row to its nearer neighbour."""
    steps = []
    for line in lines:
        at, place = page.rows[line.place].middle, line.place
        around = [abs(at - page.rows[k].middle) for k in (place - 1, place + 1) if 0 <= k < len(page.rows)]
        steps.append(min(around))
    return median(steps)


def lines_of_items(page: PageRows, model: TableModel, body: TableBody) -> list[list[RowCells]]:
    """The lines of every item, from the top down: rows of text go to the item above them, or to the one below."""
    at_top = np.log((model.at_top + 0.5) / (model.at_bottom + 0.5))
    anchors = [line.place for line, _ in body.items]
    for line in body.loose:
        above = [place for place in anchors if place < line.place]
        below = [place for place in anchors if place > line.place]
        if not above or not below:
            at_top += 1.5 if above else -1.5
            continue
        middle = page.rows[line.place].middle
        to_above, to_below = middle - page.rows[above[-1]].middle, page.rows[below[0]].middle - middle
        at_top += float(np.clip((to_below - to_above) / (0.1 * page.em), -1.0, 1.0))
    groups: dict[int, list[RowCells]] = {line.place: [line] for line, _ in body.items}
    for line in body.loose:
        above = [place for place in anchors if place < line.place]
        below = [place for place in anchors if place > line.place]
        chosen = (above[-1:] or below[:1]) if at_top > 0 else (below[:1] or above[-1:])
        groups[chosen[0]].append(line)
    return [sorted(lines, key=lambda each: each.place) for lines in groups.values()]


def _is_numeric(kinds: Mapping[str, float]) -> bool:
    return sum(kinds.get(kind, 0.0) for kind in NUMERIC) > 0.5 * sum(kinds.values())
