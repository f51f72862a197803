"""A table of items in HTML: its header, a row for each item, a cell for each column."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement


@dataclass(frozen=True, slots=True)
class HtmlTable:
    """Labels of the columns, the words above them (None: none), and the texts of cells, "" for none."""

    columns: tuple[str, ...]
    headers: tuple[str | None, ...]
    rows: Sequence[Sequence[str]]


def write_table(table: HtmlTable, element: Element, clean: Callable[[str], str]) -> None:
    """Fill a `table` element; `clean` takes out what HTML does not allow. Headers name the label of their column."""
    element.text = "\n"
    head = SubElement(SubElement(element, "thead"), "tr")
    for label, header in zip(table.columns, table.headers, strict=True):
        cell = SubElement(head, "th", {"scope": "col", "data-label": clean(label)})
        cell.text = clean(header or label)
    body = SubElement(element, "tbody")
    body.text = "\n"
    for texts in table.rows:
        row = SubElement(body, "tr")
        row.tail = "\n"
        for text in texts:
            cell = SubElement(row, "td")
            first, *others = clean(text).split("\n")
            cell.text = first
            for line in others:
                SubElement(cell, "br").tail = line
