"""Lists of results as tables, in CSV files and workbooks: a row for each value, or for each document."""

import csv
import io
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

from app.schemas.layout_results import ResultEntry
from services.contract.answers.layout import LabelField
from services.errors import InvalidOption

Cell = str | float | None
Row = Sequence[Cell]
Written = Callable[[str | None], str | None]
"""What a kind of file does to texts that were read or sent, so that they stay texts."""

COLUMNS_OF_VALUES = (
    "result",
    "created",
    "state",
    "class",
    "probability",
    "label",
    "type",
    "value",
    "currency",
    "problem",
    "confidence",
    "text",
    "file_name",
)
COLUMNS_OF_DOCUMENTS = ("result", "file_name", "created", "state", "class", "probability")
"""Before those of the labels."""
MOST_LABELS = 8000
"""A sheet has room for 16 384 columns, two for each label."""
_STATES = ("open", "skipped", "corrected", "confirmed")
"""A document has the first of these that one of its pages has."""
_NOT_LOOKED_AT = ("open", "skipped")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""First letters by which spreadsheets take a text as a formula."""
_LONGEST_CELL = 32_767
"""Characters of a cell of a workbook."""
_NOT_IN_WORKBOOKS = re.compile("[^\t\n\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def rows_of_values(entries: Iterable[ResultEntry], written: Written) -> Iterator[Row]:
    """The names of the columns, then a row for each value."""
    yield COLUMNS_OF_VALUES
    for entry in entries:
        for field in entry.fields:
            yield (
                entry.id,
                entry.created.isoformat(),
                entry.state,
                entry.class_,
                entry.probability,
                written(field.label),
                field.type,
                _value(field, written),
                field.currency,
                field.problem,
                field.confidence,
                written(field.text),
                written(entry.file_name),
            )


def rows_of_documents(documents: Mapping[str, Sequence[ResultEntry]], written: Written) -> Iterator[Row]:
    """The names of the columns, then a row for each document: by its id, from the entries of its pages in their order.

    Labels have two columns each, in alphabetical order: the value, or the text where there is none, and its confidence.
    Of a label on several pages, the first one counts that has a value, or else the first one. A document of no known
    class has none before a person has looked at it: its labels are those of the nearest class.

    Raises
    ------
    InvalidOption
        When the documents have more than `MOST_LABELS` labels.
    """
    fields = {id: _fields(pages) for id, pages in documents.items()}
    labels = sorted({label for own in fields.values() for label in own})
    if len(labels) > MOST_LABELS:
        raise InvalidOption(
            f"rows: these documents have {len(labels)} labels, and a row has room for {MOST_LABELS}. Send a smaller "
            "limit, or rows=values.",
            "rows",
        )
    names = [name for label in labels for name in (label, f"{label} confidence")]
    yield (*COLUMNS_OF_DOCUMENTS, *map(written, names_of_columns(names, COLUMNS_OF_DOCUMENTS)))
    for id, pages in documents.items():
        first = pages[0]
        yield (
            id,
            written(first.file_name),
            first.created.isoformat(),
            _state(pages),
            first.class_,
            first.probability,
            *(cell for label in labels for cell in _cells(fields[id].get(label), written)),
        )


def _fields(pages: Sequence[ResultEntry]) -> dict[str, LabelField]:
    """What a document's row shows of each label; see `rows_of_documents`."""
    found: dict[str, LabelField] = {}
    if pages[0].class_ is None and _state(pages) in _NOT_LOOKED_AT:
        return found
    for field in chain.from_iterable(page.fields for page in pages):
        if field.label not in found or (found[field.label].value is None and field.value is not None):
            found[field.label] = field
    return found


def _state(pages: Sequence[ResultEntry]) -> str:
    states = {page.state for page in pages}
    return next(state for state in _STATES if state in states)


def names_of_columns(names: Sequence[str], taken: Collection[str]) -> list[str]:
    """The names of columns, those that are taken, or occur again, with ` (label)` behind them: each name once."""
    used, found = set(taken), []
    for name in names:
        own = name
        while own in used:
            own += " (label)"
        used.add(own)
        found.append(own)
    return found


def _cells(field: LabelField | None, written: Written) -> tuple[Cell, Cell]:
    if field is None:
        return None, None
    return written(field.text) if field.value is None else _value(field, written), field.confidence


def _value(field: LabelField, written: Written) -> str | None:
    """The value; those of other types are numbers, dates and addresses, and no formula."""
    return written(field.value) if field.type in ("text", "pattern") else field.value


def harmless(text: str | None) -> str | None:
    """A text that no spreadsheet takes as a formula: an apostrophe stands before its first letter if one could."""
    return f"'{text}" if text and text.startswith(_FORMULA) else text


def as_it_is(text: str | None) -> str | None:
    """The same text: cells of workbooks say themselves that they hold a text."""
    return text


def write_csv(rows: Iterable[Row]) -> str:
    """The rows as RFC 4180 has them."""
    text = io.StringIO()
    csv.writer(text).writerows(rows)
    return text.getvalue()


def write_workbook(sheets: Mapping[str, Iterable[Row]]) -> bytes:
    """A workbook (XLSX) of sheets by their titles; every text is a text there, whatever it begins with.

    Rows wait in a temporary file, not in memory. Texts lose what XML cannot hold, and what is beyond `_LONGEST_CELL`.
    """
    # Half a second and 25 MB, which only a service that writes workbooks needs.
    from openpyxl import Workbook
    from openpyxl.cell import WriteOnlyCell

    workbook = Workbook(write_only=True)

    def cell(sheet: Any, value: Cell) -> Any:
        if not isinstance(value, str):
            return value
        text = WriteOnlyCell(sheet, _NOT_IN_WORKBOOKS.sub("", value)[:_LONGEST_CELL])
        text.data_type = "s"  # it would be a formula, or one of the words for errors
        return text

    for title, rows in sheets.items():
        sheet = workbook.create_sheet(title)
        for row in rows:
            sheet.append([cell(sheet, each) for each in row])
    file = io.BytesIO()
    workbook.save(file)
    return file.getvalue()
