"""Tables of items in answers of POST /layout: line items of invoices, rows of lists."""

from typing import Literal

from pydantic import Field

from services.contract.answers.page import FOUND, Answer, is_absent
from services.contract.fields import FieldType, ValueProblem


class FoundCell(Answer):
    """What was found of a cell before a person corrected it."""

    text: str
    confidence: float = Field(ge=0, le=1)


class ItemCell(Answer):
    """One cell of a table."""

    box: tuple[float, float, float, float] = Field(description="x0, y0, x1, y1 in pixels of the page.")
    text: str = Field(description="A line for each printed one.")
    value: str | None = Field(
        default=None,
        description="The text normalized by the type of its column, as in `fields`; null: see `problem`.",
    )
    currency: str | None = Field(
        default=None, description="Currency of an amount (ISO 4217), if it is known."
    )
    problem: ValueProblem | None = Field(default=None, description="As in `fields`.")
    confidence: float = Field(
        ge=0,
        le=1,
        description="Probability that the class, the row and the column of the cell and its text are right.",
    )
    found: FoundCell | None = Field(default=None, exclude_if=is_absent, description=FOUND)


class TableChecks(Answer):
    """What the numbers of a table say of each other, where samples show what they should; null: not checked."""

    products: Literal["fit", "differ"] | None = Field(
        default=None,
        description="Whether one column is the product of two others, such as quantity and price.",
    )
    unlike_rows: list[int] = Field(
        default=[], description="Rows, from 0, in which it is not; their cells are less sure."
    )
    sum: Literal["fits", "differs"] | None = Field(
        default=None,
        description="Whether the amounts of all rows of the document add up to an amount printed below, before or "
        "after taxes.",
    )


class ItemTable(Answer):
    """A table whose columns the settings of the class name (`items`)."""

    columns: list[str] = Field(
        description="Labels of the columns that were found, in the order of the settings."
    )
    types: list[FieldType] = Field(description="Types of their values, by the settings of the class.")
    headers: list[str | None] = Field(description="What is printed above each column; null: nothing is.")
    box: tuple[float, float, float, float] = Field(
        description="x0, y0, x1, y1 in pixels of the page, with the header."
    )
    rows: list[list[ItemCell | None]] = Field(
        description="From the top down, a cell or null for each column. A page can go on with the table of the page "
        "before."
    )
    checks: TableChecks = Field(default=TableChecks())


class DocumentTable(Answer):
    """A table of a document: the rows of its pages, one below the other."""

    columns: list[str] = Field(description="As in `tables` of the pages.")
    types: list[FieldType] = Field(description="As in `tables` of the pages.")
    headers: list[str | None] = Field(description="As on the first of its pages.")
    pages: list[int] = Field(description="For each row the index of its page in `pages` of the document.")
    rows: list[list[ItemCell | None]]
    checks: TableChecks = Field(default=TableChecks(), description="`unlike_rows` are indices of `rows`.")


def tables_of_document(pages: list[list[ItemTable]]) -> list[DocumentTable]:
    """The tables of all pages; the first one of a page goes on with the last one of the page before.

    It does so where both have the same columns, and no page lies between.
    """
    joined: list[DocumentTable] = []
    last_page = -1
    for place, tables in enumerate(pages):
        for number, table in enumerate(tables):
            known = joined[-1] if joined and number == 0 and last_page == place - 1 else None
            if known is None or known.columns != table.columns:
                known = DocumentTable(
                    columns=table.columns, types=table.types, headers=table.headers, pages=[], rows=[]
                )
                joined.append(known)
            known.checks = _both(known.checks, table.checks, len(known.rows))
            known.pages += [place] * len(table.rows)
            known.rows += table.rows
            last_page = place
    return joined


def _both(one: TableChecks, other: TableChecks, rows_before: int) -> TableChecks:
    products = {one.products, other.products} - {None}
    return TableChecks(
        products="differ" if "differ" in products else "fit" if products else None,
        unlike_rows=[*one.unlike_rows, *(row + rows_before for row in other.unlike_rows)],
        sum=other.sum or one.sum,
    )
