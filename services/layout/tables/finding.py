"""The tables of a page: from its words and what samples teach of columns to rows of cells.

A table begins below a header, whose words samples know, or where rows look like items. The words of the header, or the
spaces that all rows leave, part the page into columns; the columns are given to the labels that explain header, kinds
of values and places best. Rows that fill these columns are items; rows between them that only have text belong to the
item above or below; a row that is neither ends the table, as sums do.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from statistics import median

import numpy as np

from services.layout.page import Page
from services.layout.tables.column_evidence import (
    Assignment,
    PrintedColumn,
    assign_columns,
    column_scores,
    header_evidence,
)
from services.layout.tables.column_products import product_rule, row_fits, with_products
from services.layout.tables.column_splits import split_at_numbers
from services.layout.tables.found_table import FoundCell, FoundTable
from services.layout.tables.print_rows import Segment, em_of, page_words, printed_rows, segments_of
from services.layout.tables.row_cells import (
    NEXT_ROW,
    PageRows,
    RowCells,
    fills,
    in_columns,
    overlap,
    row_cells,
    text_of,
)
from services.layout.tables.table_body import TableBody, find_body, lines_of_items
from services.layout.tables.table_model import TableModel
from services.layout.values.kinds import NUMERIC, kind_of

MOST_TABLES = 4
"""Of a page."""
_MOST_STARTS = 12
"""Places of a page where a table is tried to begin, the best ones; one takes 1 ms."""
_MOST_LINES = 3
"""Rows above the first one with numbers among which an unknown header is looked for."""
_HEADER_HIT = 0.7
"""Log odds of a header's word from which on it is one of a label."""
_LEAST_SCORE = 2.0
"""Of a table; the sum of log likelihood ratios of its columns and of its rows, of which no more than `_MOST_ROWS`."""
_MOST_ROWS = 3.0


def find_tables(page: Page, model: TableModel, before: FoundTable | None = None) -> tuple[FoundTable, ...]:
    """The tables of a page, from the top down; none where nothing was read.

    `before` is the last table of the page before, which may go on without a header.
    """
    words = page_words(page)
    if not words or not model.columns:
        return ()
    rows, em = tuple(printed_rows(words)), em_of(words)
    printed = PageRows(em, rows, tuple(segments_of(row, em) for row in rows))
    search = _Search(printed, page.width, model)
    found: list[FoundTable] = []
    taken: set[int] = set()
    for _ in range(MOST_TABLES):
        starts = search.below_headers(taken) if found else search.tables(before)
        tried = [each for each in starts if each.found.score >= _LEAST_SCORE]
        if not tried:
            break
        best = max(tried, key=lambda each: each.found.score)
        found.append(best.found)
        taken |= best.used
    return tuple(sorted(found, key=lambda each: each.box[1]))


@dataclass(frozen=True, slots=True, eq=False)
class _Tried:
    found: FoundTable
    used: frozenset[int]


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """The rows of a page `width` pixels wide, and the table that is looked for."""

    print: PageRows
    width: float
    model: TableModel

    def tables(self, before: FoundTable | None) -> Iterator[_Tried]:
        """Tables from every place where one may begin."""
        yield from self.below_headers(set())
        for first in islice(self._run_starts(), _MOST_STARTS):
            for seeds in self._seeds_without_header(first, before):
                for tried in self._tables((), seeds, first, set(), before):
                    # Two numbers and a text are an item only where others are like it, or its numbers are a product.
                    rows = tried.found.rows
                    is_alone = before is None and not tried.found.headers and len(rows) == 1
                    if not is_alone or self._is_product(rows[0]):
                        yield tried

    def _is_product(self, row: Mapping[str, FoundCell]) -> bool:
        """Whether the numbers of an item are factors and product of the samples' rule."""
        return bool(row_fits(product_rule(self.model), {label: cell.text for label, cell in row.items()}))

    def below_headers(self, taken: set[int]) -> Iterator[_Tried]:
        """Tables below a header that samples know."""
        starts = sorted(self._headers(taken), key=lambda each: -each[1])[:_MOST_STARTS]
        for header, _ in starts:
            yield from self._tables_below(header, taken)

    def _headers(self, taken: set[int]) -> Iterator[tuple[int, float]]:
        """Rows that may be a header, and how much their words say so."""
        least = max(1, min(2, len(self.model.columns)))
        for place, parts in enumerate(self.print.parts):
            if place in taken or len(parts) < least:
                continue
            hits: dict[str, float] = {}
            for part in parts:
                for label, odds in header_evidence(self.model, part.text).items():
                    hits[label] = max(hits.get(label, 0.0), odds)
            known = [odds for odds in hits.values() if odds > _HEADER_HIT]
            if len(known) >= least:
                yield place, sum(known)

    def _run_starts(self) -> Iterator[int]:
        """First rows of runs that look like items."""
        last = -np.inf
        for place, row in enumerate(self.print.rows):
            if not self._looks_like_item(place):
                continue
            if row.middle - last > NEXT_ROW * self.print.em:
                yield place
            last = row.middle

    def _looks_like_item(self, place: int) -> bool:
        parts = self.print.parts[place]
        numbers = sum(kind_of(part.text) in NUMERIC for part in parts)
        return len(parts) >= min(3, len(self.model.columns)) and numbers >= 1

    def _tables_below(self, header: int, taken: set[int]) -> Iterator[_Tried]:
        """Tables below a header; a second line of the header belongs to it."""
        headers = [header]
        above = header - 1
        if above >= 0 and above not in taken and self._is_more_header(above, header):
            headers.insert(0, above)
        below = header + 1
        if below < len(self.print.rows) and below not in taken and self._is_more_header(below, header):
            headers.append(below)
        seeds = _merged(
            [[part] for part in self.print.parts[header]],
            [part for place in headers if place != header for part in self.print.parts[place]],
        )
        first = next(iter(self.print.below(headers[-1], taken)), None)
        if first is None:
            return
        columns = [
            PrintedColumn(
                min(part.box[0] for part in seed),
                max(part.box[2] for part in seed),
                " ".join(part.text for part in sorted(seed, key=lambda each: each.box[1])),
            )
            for seed in seeds
        ]
        yield from self._tables(tuple(headers), columns, first, taken, None)

    def _is_more_header(self, place: int, header: int) -> bool:
        """Whether a row next to a header is another line of it: near, small words over the same columns, no number."""
        near = abs(self.print.rows[place].middle - self.print.rows[header].middle) < 1.35 * self.print.em
        parts, main = self.print.parts[place], self.print.parts[header]
        return (
            near
            and len(parts) <= len(main)
            and all(kind_of(part.text) not in NUMERIC for part in parts)
            and all(sum(overlap(part.box, other.box) > 0 for other in main) == 1 for part in parts)
            and self._header_words(parts) > _HEADER_HIT
        )

    def _header_words(self, parts: Sequence[Segment]) -> float:
        return max(
            (odds for part in parts for odds in header_evidence(self.model, part.text).values()), default=0.0
        )

    def _seeds_without_header(self, first: int, before: FoundTable | None) -> Iterator[list[PrintedColumn]]:
        """Columns of a table of which no header is known: those of the page before, or what all rows leave free."""
        if before is not None:
            yield [PrintedColumn(left, right, header) for left, right, header in before.grid]
        rows = [first, *(place for place in self.print.below(first, set()) if self._looks_like_item(place))]
        most = median(len(self.print.parts[place]) for place in rows)
        rows = [place for place in rows if len(self.print.parts[place]) >= most]
        intervals = sorted((part.box[0], part.box[2]) for place in rows for part in self.print.parts[place])
        merged: list[list[float]] = []
        for left, right in intervals:
            if merged and left < merged[-1][1] + 0.2 * self.print.em:
                merged[-1][1] = max(merged[-1][1], right)
            else:
                merged.append([left, right])
        if len(merged) >= min(2, len(self.model.columns)):
            yield [PrintedColumn(left, right) for left, right in merged]

    def _tables(
        self,
        headers: tuple[int, ...],
        seeds: Sequence[PrintedColumn],
        first: int,
        taken: set[int],
        before: FoundTable | None,
    ) -> Iterator[_Tried]:
        """The table whose first row is at or below `first`, in columns that begin as `seeds`, and cut at numbers."""
        places = [first, *self.print.below(first, taken)]
        columns, lines = in_columns(self.print, seeds, places)
        if not headers and before is None:
            headers, columns = self._with_header_above(first, columns)
            places = [*range(headers[0] + 1, first), *places] if headers else places
        variants = [columns]
        above = [word for place in headers for word in self.print.rows[place].words]
        usual = [line for line in lines if fills(line, columns)] or lines[:1]
        finer = split_at_numbers(columns, [line.cells for line in usual], above, self.print.em)
        if len(finer) > len(columns):
            variants.append(finer)
        for columns in variants:
            measured, lines = in_columns(self.print, columns, places)
            if (tried := self._table(headers, measured, lines, before)) is not None:
                yield tried

    def _with_header_above(
        self, first: int, columns: list[PrintedColumn]
    ) -> tuple[tuple[int, ...], list[PrintedColumn]]:
        """The row above the first item that may be a header, and the columns with its words; none, and the same ones.

        Lines of the first item's text may be between them.
        """
        for place in range(first - 1, max(-1, first - 1 - _MOST_LINES), -1):
            if self.print.rows[place + 1].middle - self.print.rows[place].middle > NEXT_ROW * self.print.em:
                break
            line = row_cells(self.print, place, columns)
            if NUMERIC & set(line.kinds().values()) or line.alien:
                break
            if len(line.cells) >= max(2, len(columns) / 2):
                named = [
                    replace(each, header=text_of(line.cells.get(k, ()))) for k, each in enumerate(columns)
                ]
                return (place,), named
        return (), columns

    def _table(
        self,
        headers: tuple[int, ...],
        columns: Sequence[PrintedColumn],
        lines: Sequence[RowCells],
        before: FoundTable | None,
    ) -> _Tried | None:
        """The table of these rows in these columns."""
        scores = column_scores(self.model, columns, self.width)
        if before is not None:
            scores += _as_before(self.model, columns, before, self.print.em)
        assignment = with_products(self.model, assign_columns(self.model, scores), scores, columns)
        if sum(place is not None for place in assignment.places.values()) < min(2, len(self.model.columns)):
            return None
        body = find_body(self.print, self.model, lines, assignment)
        if not body.items:
            return None
        return self._found(headers, columns, assignment, body)

    def _found(
        self,
        headers: tuple[int, ...],
        columns: Sequence[PrintedColumn],
        assignment: Assignment,
        body: TableBody,
    ) -> _Tried:
        label_of = {place: label for label, place in assignment.places.items() if place is not None}
        groups = lines_of_items(self.print, self.model, body)
        rows = []
        for (_, odds), lines in zip(body.items, groups, strict=True):
            cells: dict[str, FoundCell] = {}
            for place, label in label_of.items():
                words = tuple(word for line in lines for word in line.cells.get(place, ()))
                if words:
                    sure = float(np.logaddexp(-assignment.sure[label], -odds))
                    cells[label] = FoundCell(words, -sure)
            rows.append(cells)
        discount = -1 if assignment.discount is None else assignment.discount
        used = frozenset((*headers, *(line.place for lines in groups for line in lines)))
        of_rows = np.log1p(sum(odds for _, odds in body.items))
        found = FoundTable(
            tuple(rows),
            tuple(text_of(line.cells.get(discount, ())) for line, _ in body.items),
            {label: (columns[place].left, columns[place].right) for place, label in label_of.items()},
            tuple((column.left, column.right, column.header) for column in columns),
            {
                label: columns[place].header
                for place, label in label_of.items()
                if headers and columns[place].header
            },
            tuple(word for place in sorted(used) for word in self.print.rows[place].words),
            assignment.score + min(_MOST_ROWS, float(of_rows)),
        )
        return _Tried(found, used)


def _merged(seeds: list[list[Segment]], more: Sequence[Segment]) -> list[list[Segment]]:
    """The parts of a header's main line, with those of its other lines that are over or below them."""
    for part in more:
        best = max(seeds, key=lambda seed: overlap(part.box, seed[0].box))
        best.append(part)
    return seeds


def _as_before(
    model: TableModel, columns: Sequence[PrintedColumn], before: FoundTable, em: float
) -> np.ndarray:
    """Scores (L, C) of columns that are where those of the page before were."""
    scores = np.zeros((len(model.columns), len(columns)))
    for row, label in enumerate(model.labels):
        if label in before.columns:
            left, right = before.columns[label]
            for place, column in enumerate(columns):
                away = min(abs(column.left - left), abs(column.right - right)) / em
                scores[row, place] = 3.0 - min(6.0, 3.0 * away)
    return scores
