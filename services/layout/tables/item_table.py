"""A table of items as it is answered: values of cells, and what its numbers say of each other."""

from dataclasses import dataclass

from services.contract.fields import FieldType, ValueProblem
from services.layout.page import Box

OF_TABLE = 0.7
"""Share of a zone that lies in a table from which on it is a part of it."""


@dataclass(frozen=True, slots=True)
class TableCell:
    """The text of a cell, a line for each printed one, and its value, as of a `recognition.fields.Field`.

    `confidence` is the probability, 0-1, that the text is right and the cell that of its row and column.
    """

    box: Box
    text: str
    value: str | None
    currency: str | None
    problem: ValueProblem | None
    confidence: float


@dataclass(frozen=True, slots=True)
class TableChecks:
    """What the numbers of a table say of each other, as far as samples say that they should.

    `products_fit` is whether in all rows that can tell one column is the product of two others, `unlike` are the places
    of the rows in which it is not. `sum_fits` is whether a column adds up to what the document prints below it. None:
    that was not checked.
    """

    products_fit: bool | None = None
    unlike: tuple[int, ...] = ()
    sum_fits: bool | None = None


@dataclass(frozen=True, slots=True)
class ItemTable:
    """A table of one page: labels and `types` of its columns, the words above them, and a cell or None for each.

    `box` is that of the table with its header, in pixels.
    """

    columns: tuple[str, ...]
    types: tuple[FieldType, ...]
    headers: tuple[str | None, ...]
    box: Box
    rows: tuple[tuple[TableCell | None, ...], ...]
    checks: TableChecks = TableChecks()
