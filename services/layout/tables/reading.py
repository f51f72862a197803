"""The tables of the pages of a document as they are answered: typed values, checks of their numbers, confidences."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from math import prod

import numpy as np
from scipy.special import expit, logit

from services.contract.fields import FieldSetting
from services.layout.page import Page, ZoneWord
from services.layout.tables.cell_numbers import number_of
from services.layout.tables.column_products import product_rule, row_fits
from services.layout.tables.finding import find_tables
from services.layout.tables.found_table import FoundCell, FoundTable
from services.layout.tables.item_table import ItemTable, TableCell, TableChecks
from services.layout.tables.print_rows import em_of, page_words, printed_rows, segments_of
from services.layout.tables.table_model import TableModel
from services.layout.values.kinds import kind_of
from services.layout.values.typed_value import find_value, plain_text

_MOST_CERTAIN = 0.995
_CHECKED = 1.5
"""Log odds by which a cell is surer whose row or column adds up, and less sure whose column does not."""
_UNLIKE = -3.0
"""Log odds of a cell of a row that does not: one of three is wrong."""
_MOST_AMOUNTS = 60
"""Amounts below a table that its sum is looked for among; the last ones."""
_CENT = Decimal("0.02")
_LARGEST_OTHER = Decimal("0.3")
"""Of a sum, of what is added or taken off; the largest rate of a value added tax is 27 % (Hungary)."""


@dataclass(frozen=True, slots=True)
class TablePlan:
    """How the tables of a page are read: the model of its class, the types of its labels, how sure the class is."""

    model: TableModel
    types: Mapping[str, FieldSetting]
    probability: float


def read_tables(pages: Sequence[Page], plans: Sequence[TablePlan | None]) -> list[tuple[ItemTable, ...]]:
    """The tables of each page of a document; none where a page has no plan."""
    found: list[tuple[FoundTable, ...]] = []
    for page, plan in zip(pages, plans, strict=True):
        before = found[-1][-1] if found and found[-1] else None
        found.append(() if plan is None else find_tables(page, plan.model, before))
    fits = _sum_fits(pages, found, plans)
    return [
        () if plan is None else tuple(_item_table(table, plan, fits) for table in tables)
        for tables, plan in zip(found, plans, strict=True)
    ]


def _item_table(table: FoundTable, plan: TablePlan, sum_fits: bool | None) -> ItemTable:
    labels = tuple(label for label in plan.model.labels if label in table.columns)
    rule, added = product_rule(plan.model), _added_label(plan)
    fits = [
        row_fits(rule, {label: cell.text for label, cell in row.items()}, discount)
        for row, discount in zip(table.rows, table.discounts, strict=True)
    ]
    unlike = tuple(k for k, each in enumerate(fits) if each is False)
    checks = TableChecks(None if all(each is None for each in fits) else not unlike, unlike, sum_fits)
    rows = []
    for row, fit in zip(table.rows, fits, strict=True):
        cells: list[TableCell | None] = []
        for label in labels:
            odds = 0.0
            if rule is not None and label in (rule.of, rule.by, rule.gives) and fit is not None:
                odds += _CHECKED if fit else _UNLIKE
            if label == added and sum_fits is not None:
                odds += _CHECKED if sum_fits else -_CHECKED
            cells.append(None if label not in row else _cell(row[label], label, plan, odds))
        rows.append(tuple(cells))
    return ItemTable(
        columns=labels,
        types=tuple(plan.types.get(label, FieldSetting()).type for label in labels),
        headers=tuple(table.headers.get(label) for label in labels),
        box=table.box,
        rows=tuple(rows),
        checks=checks,
    )


def _cell(cell: FoundCell, label: str, plan: TablePlan, checked: float) -> TableCell:
    text = cell.text
    value = find_value(plain_text(text), plan.types.get(label, FieldSetting()))
    right = float(expit(cell.sure)) * prod(word.confidence for word in cell.words)
    odds = float(logit(np.clip(right, 1.0 - _MOST_CERTAIN, _MOST_CERTAIN))) + checked
    return TableCell(
        cell.box, text, value.value, value.currency, value.problem, plan.probability * float(expit(odds))
    )


def _added_label(plan: TablePlan) -> str | None:
    """The column that adds up: the product of others, else the last one of amounts."""
    rule = product_rule(plan.model)
    if rule is not None:
        return rule.gives
    typed = [
        label for label in plan.model.labels if (each := plan.types.get(label)) and each.type == "amount"
    ]
    return typed[-1] if typed else None


def _sum_fits(
    pages: Sequence[Page], found: Sequence[Sequence[FoundTable]], plans: Sequence[TablePlan | None]
) -> bool | None:
    """Whether a column of all tables adds up to an amount below the last one, or to one with or without another one.

    None where a row has no amount, no column adds up, nothing is printed below, or the other one is more than a tax or
    a discount: it may be an item that was not found.
    """
    plan = next(
        (plan for plan, tables in zip(plans, found, strict=True) if plan is not None and tables), None
    )
    label = None if plan is None else _added_label(plan)
    if label is None:
        return None
    cells = [row.get(label) for tables in found for table in tables for row in table.rows]
    numbers = [None if cell is None else number_of(cell.text) for cell in cells]
    below = _amounts_below(pages, found)
    if not numbers or None in numbers or not below:
        return None
    total = sum((number for number in numbers if number is not None), Decimal(0))
    if any(abs(amount - total) <= _CENT for amount in below):
        return True
    # A tax leads to more than the sum, a discount to less.
    others = [
        part
        for part in below
        for whole in below
        if part and whole > part and min(abs(total + part - whole), abs(total - part - whole)) <= _CENT
    ]
    if any(part <= _LARGEST_OTHER * total for part in others):
        return True
    return None if others else False


def _amounts_below(pages: Sequence[Page], found: Sequence[Sequence[FoundTable]]) -> list[Decimal]:
    """The amounts printed after the last table, on its page and on those that follow."""
    last = max(place for place, tables in enumerate(found) if tables)
    amounts: list[Decimal] = []
    for place, page in enumerate(pages[last:], last):
        words = page_words(page)
        bottom = max((table.box[3] for table in found[place]), default=0.0)
        below = [word for word in words if _middle(word) > bottom]
        for row in printed_rows(below):
            for part in segments_of(row, em_of(words)):
                if kind_of(part.text) == "amount" and (number := number_of(part.text)) is not None:
                    amounts.append(number)
    return amounts[-_MOST_AMOUNTS:]


def _middle(word: ZoneWord) -> float:
    return (word.box[1] + word.box[3]) / 2
