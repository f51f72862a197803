"""Tables of items of results as rows of CSV files and workbooks: a row for each item."""

import re
from collections.abc import Iterator, Mapping, Sequence

from app.routes.result_tables import Cell, Row, Written, names_of_columns
from app.schemas.layout_results import ResultEntry
from services.contract.answers.tables import DocumentTable, ItemCell, tables_of_document

COLUMNS_OF_ITEMS = ("result", "file_name", "class", "table", "page", "row", "confidence")
"""Before those of the labels; tables, pages and rows are counted from 1."""
_LONGEST_TITLE = 31
"""Letters of the name of a sheet."""
_NOT_IN_TITLES = re.compile(r"[\[\]:*?/\\]|[^\x20-\ud7ff\ue000-\ufffd]")

Documents = Mapping[str, Sequence[ResultEntry]]
"""The entries of the pages of each document, in their order, by its id."""


def rows_of_items(documents: Documents, written: Written) -> Iterator[Row]:
    """The names of the columns, then a row for each item.

    Labels have a column each, in the order in which the documents have them: the value, or the text where there is
    none. `confidence` is the least one of the cells of the row.
    """
    tables = {id: _tables(pages) for id, pages in documents.items()}
    labels = list(dict.fromkeys(label for own in tables.values() for table in own for label in table.columns))
    yield (*COLUMNS_OF_ITEMS, *map(written, names_of_columns(labels, COLUMNS_OF_ITEMS)))
    for id, own in tables.items():
        first = documents[id][0]
        for number, table in enumerate(own, 1):
            for place, (page, row) in enumerate(zip(table.pages, table.rows, strict=True), 1):
                cells = dict(zip(table.columns, row, strict=True))
                types = dict(zip(table.columns, table.types, strict=True))
                sure = min((cell.confidence for cell in row if cell is not None), default=None)
                yield (
                    id,
                    written(first.file_name),
                    first.class_,
                    number,
                    page + 1,
                    place,
                    sure,
                    *(_shown(cells.get(label), types.get(label), written) for label in labels),
                )


def sheets_of_items(documents: Documents, written: Written) -> dict[str, Iterator[Row]]:
    """A sheet of items for each class whose documents have a table, by the title of the sheet."""
    by_class: dict[str, dict[str, Sequence[ResultEntry]]] = {}
    for id, pages in documents.items():
        if any(page.tables for page in pages):
            by_class.setdefault(pages[0].class_ or "", {})[id] = pages
    sheets: dict[str, Iterator[Row]] = {}
    for number, (name, own) in enumerate(sorted(by_class.items()), 1):
        title = _NOT_IN_TITLES.sub("", f"items {name}").strip()[:_LONGEST_TITLE]
        if title.casefold() in map(str.casefold, sheets):
            title = f"items {number}"
        sheets[title] = rows_of_items(own, written)
    return sheets


def _tables(pages: Sequence[ResultEntry]) -> list[DocumentTable]:
    return tables_of_document([page.tables for page in pages])


def _shown(cell: ItemCell | None, type_: str | None, written: Written) -> Cell:
    if cell is None:
        return None
    if cell.value is None:
        return written(cell.text)
    return written(cell.value) if type_ in ("text", "pattern") else cell.value
