"""What labelled pages teach of a table: from the cells of one or two rows, and from the rows that follow from them."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import reduce

from services.contract.boxes import CELL_IN_ROW, common_height, holds_middle
from services.layout.page import Box, Page, ZoneWord
from services.layout.tables.cell_numbers import number_of, size_of
from services.layout.tables.column_products import count_products
from services.layout.tables.finding import find_tables
from services.layout.tables.found_table import FoundTable
from services.layout.tables.gathering import gather_zones
from services.layout.tables.print_rows import (
    PrintedRow,
    Segment,
    box_of,
    em_of,
    header_words,
    page_words,
    printed_rows,
    segments_of,
)
from services.layout.tables.table_model import MOST_HEADER_WORDS, ColumnModel, Sums, TableModel
from services.layout.values.kinds import NUMERIC, kind_of

_FAR = 2.5
"""Largest distance of the edges, or the middles, of a column and its header, in em."""
_MOST_CLIMBED = 60
"""Rows above the labelled one among which the header is."""

LabelledRow = Mapping[str, tuple[ZoneWord, ...]]
"""The words of each cell of a row by label."""


@dataclass(frozen=True, slots=True, eq=False)
class TablePage:
    """A page with labelled cells: all that is printed, in the zones of segmentation, and the cells by label."""

    printed: Page
    cells: Sequence[tuple[str, Box]]


def table_page(verified: Page, found: Page | None, items: Sequence[str]) -> TablePage:
    """What a verified page says of the table; `found` is the same page in the zones of segmentation."""
    cells = [
        (zone.label, zone.box) for zone in verified.zones if zone.label is not None and zone.label in items
    ]
    return TablePage(verified if found is None else found, cells)


def learn_table(
    pages: Iterable[TablePage], items: Sequence[str], known: TableModel | None = None
) -> TableModel | None:
    """The model of the table with the columns `items`, after `pages`, and after those that `known` comes from.

    Columns of `known` that are no items any more are forgotten. None where no page ever had a cell.
    """
    old = {column.label: column for column in known.columns} if known is not None else {}
    model = TableModel(tuple(old.get(label, ColumnModel(label)) for label in items))
    if known is not None:
        kept = tuple(rule for rule in known.products if {rule.of, rule.by, rule.gives} <= set(items))
        model = replace(known, columns=model.columns, products=kept)
    taught = [(page, rows) for page in pages if (rows := labelled_rows(page))]
    for page, rows in taught:
        model = _with_page(model, page, rows)
    begun = model
    for page, rows in taught:
        model = _with_found(model, begun, page, rows)
    return model if model.samples else None


def labelled_rows(page: TablePage) -> list[LabelledRow]:
    """The labelled cells of a page by rows, from the top down; cells without a word are left out."""
    words = page_words(page.printed)
    cells = [(label, box, own) for label, box in page.cells if (own := _inside(words, box))]
    rows: list[tuple[Box, dict[str, tuple[ZoneWord, ...]]]] = []
    for label, box, own in sorted(cells, key=lambda each: each[1][1]):
        for place, (around, row) in enumerate(rows):
            if label not in row and common_height(box, around) > CELL_IN_ROW:
                row[label] = own
                rows[place] = _hull(around, box), row
                break
        else:
            rows.append((box, {label: own}))
    return [row for _, row in rows]


def _inside(words: Sequence[ZoneWord], box: Box) -> tuple[ZoneWord, ...]:
    """The words whose middle is in a box."""
    return tuple(word for word in words if holds_middle(box, word.box))


def _hull(a: Box, b: Box) -> Box:
    return min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])


def _with_page(model: TableModel, page: TablePage, rows: Sequence[LabelledRow]) -> TableModel:
    """The model after the labelled cells of a page and the header above them."""
    headers = _headers_of(page, rows)
    columns = []
    for column in model.columns:
        cells = [row[column.label] for row in rows if column.label in row]
        if not cells:
            columns.append(replace(column, rows=column.rows + len(rows)))
            continue
        header = list(dict.fromkeys(header_words(headers.get(column.label, ""))))
        columns.append(
            replace(
                _with_cells(column, cells, len(rows), page.printed.width),
                samples=column.samples + 1,
                headers=_most_frequent(Counter(column.headers) + Counter(dict.fromkeys(header, 1.0))),
            )
        )
    top, bottom = _anchors(rows)
    return replace(
        model,
        columns=tuple(columns),
        samples=model.samples + 1,
        at_top=model.at_top + top,
        at_bottom=model.at_bottom + bottom,
        products=count_products(_texts(rows), model.labels, model.products),
    )


def _with_found(
    model: TableModel, begun: TableModel, page: TablePage, rows: Sequence[LabelledRow]
) -> TableModel:
    """The model after the other rows of a labelled page, where the table that follows has the labelled cells."""
    table = table_with(find_tables(page.printed, begun), rows)
    if table is None:
        return model
    labelled = {word for row in rows for words in row.values() for word in words}
    found = [{label: cell.words for label, cell in row.items()} for row in table.rows]
    more = [row for row in found if not any(word in labelled for words in row.values() for word in words)]
    columns = tuple(
        _with_cells(
            column, [row[column.label] for row in more if column.label in row], len(more), page.printed.width
        )
        for column in model.columns
    )
    return replace(
        model, columns=columns, products=count_products(_texts(more), model.labels, model.products)
    )


def table_with(tables: Sequence[FoundTable], rows: Sequence[LabelledRow]) -> FoundTable | None:
    """The table that has the labelled cells, each with the words that were labelled; None where none has them."""
    for table in tables:
        found = [{label: frozenset(cell.words) for label, cell in row.items()} for row in table.rows]
        if all(
            any(all(own.get(label) == frozenset(words) for label, words in row.items()) for own in found)
            for row in rows
        ):
            return table
    return None


def _texts(rows: Sequence[LabelledRow]) -> list[dict[str, str]]:
    return [{label: _text(words) for label, words in row.items()} for row in rows]


def _text(words: Sequence[ZoneWord]) -> str:
    return " ".join(word.text for row in printed_rows(words) for word in row.words)


def _with_cells(
    column: ColumnModel, cells: Sequence[Sequence[ZoneWord]], rows: int, width: float
) -> ColumnModel:
    kinds = Counter(column.kinds) + Counter(kind_of(_text(words)) for words in cells)
    left, right = column.left, column.right
    if cells:  # one edge of a page, however many rows it has
        left = _added(left, min(box_of(words)[0] for words in cells) / width)
        right = _added(right, max(box_of(words)[2] for words in cells) / width)
    return replace(
        column,
        cells=column.cells + len(cells),
        rows=column.rows + rows,
        kinds=dict(sorted(kinds.items())),
        left=left,
        right=right,
        sizes=reduce(_added, map(size_of, filter(None, map(number_of, map(_text, cells)))), column.sizes),
    )


def _added(sums: Sums, value: float) -> Sums:
    return sums[0] + 1, round(sums[1] + value, 5), round(sums[2] + value**2, 7)


def _most_frequent(words: Mapping[str, float]) -> dict[str, float]:
    kept = sorted(words.items(), key=lambda each: (-each[1], each[0]))[:MOST_HEADER_WORDS]
    return dict(sorted(kept))


def _anchors(rows: Sequence[LabelledRow]) -> tuple[float, float]:
    """Rows of several lines whose cells of one line are on the first, and on the last one."""
    top = bottom = 0.0
    for row in rows:
        lines = {label: printed_rows(words) for label, words in row.items()}
        tall = max(lines.values(), key=len)
        if len(tall) < 2:
            continue
        single = [own[0].middle for own in lines.values() if len(own) == 1]
        if single:
            middle = sum(single) / len(single)
            is_top = abs(middle - tall[0].middle) < abs(middle - tall[-1].middle)
            top, bottom = top + is_top, bottom + (not is_top)
    return top, bottom


def _headers_of(page: TablePage, rows: Sequence[LabelledRow]) -> dict[str, str]:
    """The header of each label: the nearest row above the labelled ones that is text where they have numbers."""
    words = page_words(page.printed)
    em = em_of(words)
    columns: dict[str, Box] = {}
    for row in rows:
        for label, own in row.items():
            columns[label] = _hull(columns.get(label, box_of(own)), box_of(own))
    numeric = {label for row in rows for label, own in row.items() if kind_of(_text(own)) in NUMERIC}
    top = min(box[1] for box in columns.values())
    printed = printed_rows(words)
    above = [row for row in printed if row.middle < top]
    for line in reversed(above[-_MOST_CLIMBED:]):
        found = _over_columns(segments_of(line, em), columns, em)
        texts = {label: " ".join(part.text for part in parts) for label, parts in found.items()}
        if len(texts) < min(2, len(columns)) or 2 * len(texts) < len(columns):
            continue
        if any(kind_of(texts[label]) in NUMERIC for label in numeric & texts.keys()):
            continue
        return _with_second_line(line, above, texts, columns, em)
    return {}


def _with_second_line(
    row: PrintedRow, above: Sequence[PrintedRow], texts: dict[str, str], columns: Mapping[str, Box], em: float
) -> dict[str, str]:
    """The header with the words of the row above it, where that is as near as a second line and has no other words."""
    place = above.index(row)
    if place and row.middle - above[place - 1].middle < 1.35 * em:
        parts = segments_of(above[place - 1], em)
        more = _over_columns(parts, columns, em)
        if sum(map(len, more.values())) == len(parts) < len(columns):
            for label, own in more.items():
                texts[label] = " ".join((*(part.text for part in own), texts.get(label, ""))).strip()
    return texts


def _over_columns(
    parts: Sequence[Segment], columns: Mapping[str, Box], em: float
) -> dict[str, list[Segment]]:
    """The parts of a row by the column that each is over, or, where none is, nearest to."""
    near: dict[str, list[tuple[float, Segment]]] = {}
    for part in parts:
        distances = {label: _from_column(part.box, box) for label, box in columns.items()}
        nearest = min(distances, key=lambda label: distances[label])
        if distances[nearest] < _FAR * em:
            near.setdefault(nearest, []).append((distances[nearest], part))
    found = {}
    for label, own in near.items():
        x0, _, x1, _ = columns[label]
        over = [part for _, part in own if min(part.box[2], x1) > max(part.box[0], x0)]
        found[label] = over or [min(own, key=lambda each: each[0])[1]]
    return found


def _from_column(box: Box, column: Box) -> float:
    """Distance of a header from its column: of the nearest of both edges and the middles, less where they overlap."""
    edges = (
        abs(box[0] - column[0]),
        abs(box[2] - column[2]),
        abs(box[0] + box[2] - column[0] - column[2]) / 2,
    )
    return min(edges) - max(0.0, min(box[2], column[2]) - max(box[0], column[0]))


def without_items(page: Page, items: Set[str]) -> Page:
    """The page without its labelled cells: the layout graph does not know them."""
    return replace(page, zones=tuple(zone for zone in page.zones if zone.label not in items))


def gathered_samples(
    pages: Sequence[Page], found: Sequence[Page | None], model: TableModel
) -> tuple[list[Page], list[Page | None]]:
    """Verified pages, and the same in the zones of segmentation, with each table as one zone without a label.

    So the layout graph learns of pages as recognition shows them to it (`gathering`).
    """
    verified, others = [], []
    items = frozenset(model.labels)
    for page, other in zip(pages, found, strict=True):
        tables = find_tables(page if other is None else other, model)
        plain = without_items(page, items)
        labels = frozenset(zone.label for zone in plain.zones if zone.label is not None)
        plain = gather_zones(plain, tables, labels)
        seen = None if other is None else gather_zones(without_labels(other, items), tables)
        verified.append(plain if plain.zones or seen is None else seen)
        others.append(seen)
    return verified, others


def without_labels(page: Page, items: Set[str]) -> Page:
    """The page whose zones have lost the labels of items."""
    zones = (replace(zone, label=None) if zone.label in items else zone for zone in page.zones)
    return replace(page, zones=tuple(zones))
