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

from services.layout.page import Box, Page, ZoneWord
from services.layout.tables.column_evidence import (
    Assignment,
    PrintedColumn,
    assign_columns,
    column_scores,
    header_evidence,
    kind_evidence,
)
from services.layout.tables.column_products import with_products
from services.layout.tables.column_splits import split_at_numbers
from services.layout.tables.print_rows import (
    NUMERIC,
    PrintedRow,
    Segment,
    box_of,
    em_of,
    kind_of,
    page_words,
    printed_rows,
    segments_of,
)
from services.layout.tables.table_model import TableModel

MOST_TABLES = 4
"""Of a page."""
MOST_ITEMS = 300
"""Of a table on one page."""
_MOST_STARTS = 12
"""Places of a page where a table is tried to begin, the best ones; one takes 1 ms."""
_HEADER_HIT = 0.7
"""Log odds of a header's word from which on it is one of a label."""
_LEAST_SCORE = 2.0
"""Of a table; the sum of log likelihood ratios of its columns and of its rows, of which no more than `_MOST_ROWS`."""
_MOST_ROWS = 3.0
_NEXT_ROW = 3.2
"""Farthest next row of a table, in em from middle to middle."""
_NEAR = 1.6
"""How far a cell may be from the print of its column, in em."""
_ALIEN = -2.0
"""Log odds of a row with print between the columns."""


@dataclass(frozen=True, slots=True)
class FoundCell:
    """The words of a cell in the order of reading, one or more; `sure` are log odds that they are this cell's."""

    words: tuple[ZoneWord, ...]
    sure: float

    @property
    def box(self) -> Box:
        return box_of(self.words)

    @property
    def text(self) -> str:
        """A line for each printed one."""
        return "\n".join(" ".join(word.text for word in row.words) for row in printed_rows(self.words))


@dataclass(frozen=True, slots=True, eq=False)
class FoundTable:
    """A table of a page: `rows` of cells by label, from the top down; a label without a cell is left out.

    `columns` has the edges in pixels of each label that the page has, `headers` what is printed above it; `words` are
    all of the table, those of its header and of columns without a label too. `discounts` are the texts of each row in
    the column of a discount, "" where there is none. `score` is how well it fits.
    """

    rows: tuple[Mapping[str, FoundCell], ...]
    discounts: tuple[str, ...]
    columns: Mapping[str, tuple[float, float]]
    headers: Mapping[str, str]
    words: tuple[ZoneWord, ...]
    score: float

    @property
    def box(self) -> Box:
        return box_of(self.words)


def find_tables(page: Page, model: TableModel, before: FoundTable | None = None) -> tuple[FoundTable, ...]:
    """The tables of a page, from the top down; none where nothing was read.

    `before` is the last table of the page before, which may go on without a header.
    """
    words = page_words(page)
    if not words or not model.columns:
        return ()
    rows = printed_rows(words)
    print_ = _Print(
        page, model, em_of(words), tuple(rows), tuple(segments_of(row, em_of(words)) for row in rows)
    )
    found: list[FoundTable] = []
    taken: set[int] = set()
    for _ in range(MOST_TABLES):
        starts = print_.below_headers(taken) if found else print_.tables(before)
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
class _Line:
    """A row in columns: the words of each column by its place; `alien` is print that is in none."""

    place: int
    cells: Mapping[int, tuple[ZoneWord, ...]]
    alien: bool

    def kinds(self) -> dict[int, str]:
        return {column: kind_of(_text(words)) for column, words in self.cells.items()}


def _text(words: Sequence[ZoneWord]) -> str:
    return " ".join(word.text for word in words)


@dataclass(frozen=True, slots=True, eq=False)
class _Print:
    """The rows of a page, what they are parted into, and the table that is looked for."""

    page: Page
    model: TableModel
    em: float
    rows: tuple[PrintedRow, ...]
    parts: tuple[list[Segment], ...]

    def tables(self, before: FoundTable | None) -> Iterator[_Tried]:
        """Tables from every place where one may begin."""
        yield from self.below_headers(set())
        for first in islice(self._run_starts(), _MOST_STARTS):
            for seeds in self._seeds_without_header(first, before):
                for tried in self._tables((), seeds, first, set(), before):
                    # Two numbers and a text are an item only where others are like it.
                    if before is not None or tried.found.headers or len(tried.found.rows) > 1:
                        yield tried

    def below_headers(self, taken: set[int]) -> Iterator[_Tried]:
        """Tables below a header that samples know."""
        starts = sorted(self._headers(taken), key=lambda each: -each[1])[:_MOST_STARTS]
        for header, _ in starts:
            yield from self._tables_below(header, taken)

    def _headers(self, taken: set[int]) -> Iterator[tuple[int, float]]:
        """Rows that may be a header, and how much their words say so."""
        least = max(1, min(2, len(self.model.columns)))
        for place, parts in enumerate(self.parts):
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
        for place, row in enumerate(self.rows):
            if not self._looks_like_item(place):
                continue
            if row.middle - last > _NEXT_ROW * self.em:
                yield place
            last = row.middle

    def _looks_like_item(self, place: int) -> bool:
        parts = self.parts[place]
        numbers = sum(kind_of(part.text) in NUMERIC for part in parts)
        return len(parts) >= min(3, len(self.model.columns)) and numbers >= 1

    def _below(self, place: int, taken: set[int]) -> Iterator[int]:
        """Rows below one, up to the first gap."""
        last = self.rows[place].middle
        for at in range(place + 1, len(self.rows)):
            if at in taken or self.rows[at].middle - last > _NEXT_ROW * self.em:
                return
            yield at
            last = self.rows[at].middle

    def _tables_below(self, header: int, taken: set[int]) -> Iterator[_Tried]:
        """Tables below a header; a second line of the header belongs to it."""
        headers = [header]
        above = header - 1
        if above >= 0 and above not in taken and self._is_more_header(above, header):
            headers.insert(0, above)
        below = header + 1
        if below < len(self.rows) and below not in taken and self._is_more_header(below, header):
            headers.append(below)
        seeds = _merged(
            [[part] for part in self.parts[header]],
            [part for place in headers if place != header for part in self.parts[place]],
        )
        first = next(iter(self._below(headers[-1], taken)), None)
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
        near = abs(self.rows[place].middle - self.rows[header].middle) < 1.35 * self.em
        parts, main = self.parts[place], self.parts[header]
        return (
            near
            and len(parts) <= len(main)
            and all(kind_of(part.text) not in NUMERIC for part in parts)
            and all(sum(_overlap(part.box, other.box) > 0 for other in main) == 1 for part in parts)
            and self._header_words(parts) > _HEADER_HIT
        )

    def _header_words(self, parts: Sequence[Segment]) -> float:
        return max(
            (odds for part in parts for odds in header_evidence(self.model, part.text).values()), default=0.0
        )

    def _seeds_without_header(self, first: int, before: FoundTable | None) -> Iterator[list[PrintedColumn]]:
        """Columns of a table of which no header is known: those of the page before, or what all rows leave free."""
        if before is not None:
            yield [
                PrintedColumn(left, right, before.headers.get(label, ""))
                for label, (left, right) in sorted(before.columns.items(), key=lambda each: each[1])
            ]
        rows = [first, *(place for place in self._below(first, set()) if self._looks_like_item(place))]
        most = median(len(self.parts[place]) for place in rows)
        rows = [place for place in rows if len(self.parts[place]) >= most]
        intervals = sorted((part.box[0], part.box[2]) for place in rows for part in self.parts[place])
        merged: list[list[float]] = []
        for left, right in intervals:
            if merged and left < merged[-1][1] + 0.2 * self.em:
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
        places = [first, *self._below(first, taken)]
        columns, lines = self._in_columns(seeds, places)
        if not headers and before is None and (named := self._with_header_above(first, columns)):
            headers, columns = (first - 1,), named
        variants = [columns]
        above = [word for place in headers for word in self.rows[place].words]
        usual = [line for line in lines if self._fills(line, columns)] or lines[:1]
        finer = split_at_numbers(columns, [line.cells for line in usual], above, self.em)
        if len(finer) > len(columns):
            variants.append(finer)
        for columns in variants:
            measured, lines = self._in_columns(columns, places)
            if (tried := self._table(headers, measured, lines, before)) is not None:
                yield tried

    def _in_columns(
        self, seeds: Sequence[PrintedColumn], places: Sequence[int]
    ) -> tuple[list[PrintedColumn], list[_Line]]:
        """The columns as wide as their print, and the rows in them."""
        columns = list(seeds)
        for _ in range(2):
            lines = [self._line(place, columns) for place in places]
            usual = [line for line in lines if self._fills(line, columns)] or lines[:1]
            columns = _widened(seeds, usual)
        return columns, [self._line(place, columns) for place in places]

    def _with_header_above(self, first: int, columns: Sequence[PrintedColumn]) -> list[PrintedColumn]:
        """The columns with the words of the row above the first one as their headers, if it may be one; else none."""
        above = first - 1
        if above < 0 or self.rows[first].middle - self.rows[above].middle > _NEXT_ROW * self.em:
            return []
        line = self._line(above, columns)
        if line.alien or len(line.cells) < max(2, len(columns) / 2) or NUMERIC & set(line.kinds().values()):
            return []
        return [replace(each, header=_text(line.cells.get(k, ()))) for k, each in enumerate(columns)]

    def _table(
        self,
        headers: tuple[int, ...],
        columns: Sequence[PrintedColumn],
        lines: Sequence[_Line],
        before: FoundTable | None,
    ) -> _Tried | None:
        """The table of these rows in these columns."""
        scores = column_scores(self.model, columns, self.page.width)
        if before is not None:
            scores += _as_before(self.model, columns, before, self.em)
        assignment = with_products(self.model, assign_columns(self.model, scores), scores, columns)
        if sum(place is not None for place in assignment.places.values()) < min(2, len(self.model.columns)):
            return None
        body = self._body(lines, assignment)
        if not body.items:
            return None
        return self._found(headers, columns, assignment, body)

    def _line(self, place: int, columns: Sequence[PrintedColumn]) -> _Line:
        """The words of a row by column: whole parts where they lie in one column, else word by word."""
        cells: dict[int, list[ZoneWord]] = {}
        alien = False
        for part in self.parts[place]:
            over = [k for k, column in enumerate(columns) if _overlap(part.box, _span(column)) > 0]
            if len(over) == 1:
                cells.setdefault(over[0], []).extend(part.words)
                continue
            for word in part.words:
                nearest = min(range(len(columns)), key=lambda k: _distance(word.box, columns[k]))
                if over or _distance(word.box, columns[nearest]) < _NEAR * self.em:
                    cells.setdefault(nearest, []).append(word)
                else:
                    alien = True
        return _Line(place, {k: tuple(words) for k, words in cells.items()}, alien)

    def _fills(self, line: _Line, columns: Sequence[PrintedColumn]) -> bool:
        """Whether a row fills most columns and has a number: what columns are measured by."""
        numbers = sum(kind in NUMERIC for kind in line.kinds().values())
        return not line.alien and len(line.cells) >= 0.6 * len(columns) and numbers >= 1

    def _body(self, lines: Sequence[_Line], assignment: Assignment) -> "_Body":
        """Items and the rows between them, from the first item to where the table ends."""
        label_of = {place: label for label, place in assignment.places.items() if place is not None}
        known = {column.label: column for column in self.model.columns}
        items: list[tuple[_Line, float]] = []
        loose: list[_Line] = []
        kept: list[_Line] = []
        for line in lines:
            kinds = line.kinds()
            odds = _ALIEN if line.alien else 0.0
            for place, label in label_of.items():
                column = known[label]
                share = (column.cells + 0.5) / (max(column.rows, column.cells) + 1.0)
                odds += (
                    kind_evidence(column, kinds[place])
                    if place in kinds
                    else np.log(2.0 * (1.0 - share) + 0.02)
                )
            number = any(kinds.get(place) in NUMERIC for place in label_of)
            if odds > 0 and (number or not self._has_numbers()):
                items.append((line, float(odds)))
                kept += loose
                loose = []
                if len(items) >= MOST_ITEMS:
                    break
            elif self._is_text_only(line, kinds, label_of):
                loose.append(line)
            elif items:
                break
            else:
                loose = []
        trailing = self._close(items[-1][0] if items else None, loose, kept)
        return _Body(tuple(items), (*kept, *trailing))

    def _has_numbers(self) -> bool:
        return any(
            column.kinds.get(kind, 0.0) > 0.5 * column.cells
            for column in self.model.columns
            for kind in NUMERIC
        )

    def _is_text_only(self, line: _Line, kinds: Mapping[int, str], label_of: Mapping[int, str]) -> bool:
        """Whether a row only has text in columns of text: the rest of a description."""
        known = {column.label: column for column in self.model.columns}
        for place in line.cells:
            label = label_of.get(place)
            if label is None or _is_numeric(known[label].kinds):
                return False
        return not line.alien and bool(line.cells)

    def _close(self, last: _Line | None, loose: Sequence[_Line], kept: Sequence[_Line]) -> tuple[_Line, ...]:
        """Of rows of text below the last item those that are as near as lines of one item are."""
        if last is None:
            return ()
        near = 1.25 * self._usual_step(kept) if kept else 1.4 * self.em
        found = []
        middle = self.rows[last.place].middle
        for line in loose:
            if self.rows[line.place].middle - middle > near:
                break
            middle = self.rows[line.place].middle
            found.append(line)
        return tuple(found)

    def _usual_step(self, lines: Sequence[_Line]) -> float:
        """Of each row to its nearer neighbour."""
        steps = []
        for line in lines:
            at, place = self.rows[line.place].middle, line.place
            around = [
                abs(at - self.rows[k].middle) for k in (place - 1, place + 1) if 0 <= k < len(self.rows)
            ]
            steps.append(min(around))
        return median(steps)

    def _found(
        self,
        headers: tuple[int, ...],
        columns: Sequence[PrintedColumn],
        assignment: Assignment,
        body: "_Body",
    ) -> _Tried:
        label_of = {place: label for label, place in assignment.places.items() if place is not None}
        groups = self._grouped(body)
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
            tuple(_text(line.cells.get(discount, ())) for line, _ in body.items),
            {label: (columns[place].left, columns[place].right) for place, label in label_of.items()},
            {label: columns[place].header for place, label in label_of.items() if columns[place].header},
            tuple(word for place in sorted(used) for word in self.rows[place].words),
            assignment.score + min(_MOST_ROWS, float(of_rows)),
        )
        return _Tried(found, used)

    def _grouped(self, body: "_Body") -> list[list[_Line]]:
        """The lines of every item, from the top down: rows of text go to the item above them, or to the one below."""
        at_top = np.log((self.model.at_top + 0.5) / (self.model.at_bottom + 0.5))
        anchors = [line.place for line, _ in body.items]
        for line in body.loose:
            above = [place for place in anchors if place < line.place]
            below = [place for place in anchors if place > line.place]
            if not above or not below:
                at_top += 1.5 if above else -1.5
                continue
            middle = self.rows[line.place].middle
            to_above, to_below = middle - self.rows[above[-1]].middle, self.rows[below[0]].middle - middle
            at_top += float(np.clip((to_below - to_above) / (0.1 * self.em), -1.0, 1.0))
        groups: dict[int, list[_Line]] = {line.place: [line] for line, _ in body.items}
        for line in body.loose:
            above = [place for place in anchors if place < line.place]
            below = [place for place in anchors if place > line.place]
            chosen = (above[-1:] or below[:1]) if at_top > 0 else (below[:1] or above[-1:])
            groups[chosen[0]].append(line)
        return [sorted(lines, key=lambda each: each.place) for lines in groups.values()]


@dataclass(frozen=True, slots=True, eq=False)
class _Body:
    """Items, each with log odds of being one, and the rows of text that belong to them."""

    items: tuple[tuple[_Line, float], ...]
    loose: tuple[_Line, ...]


def _is_numeric(kinds: Mapping[str, float]) -> bool:
    return sum(kinds.get(kind, 0.0) for kind in NUMERIC) > 0.5 * sum(kinds.values())


def _overlap(box: Box, other: Box) -> float:
    return min(box[2], other[2]) - max(box[0], other[0])


def _span(column: PrintedColumn) -> Box:
    return column.left, 0.0, column.right, 0.0


def _distance(box: Box, column: PrintedColumn) -> float:
    """From a word to a column, negative where they overlap."""
    return max(column.left - box[2], box[0] - column.right)


def _merged(seeds: list[list[Segment]], more: Sequence[Segment]) -> list[list[Segment]]:
    """The parts of a header's main line, with those of its other lines that are over or below them."""
    for part in more:
        best = max(seeds, key=lambda seed: _overlap(part.box, seed[0].box))
        best.append(part)
    return seeds


def _widened(seeds: Sequence[PrintedColumn], lines: Sequence[_Line]) -> list[PrintedColumn]:
    """The columns as wide as the words of these rows, with the kinds of their cells; none reaches into the next one."""
    found = []
    for place, seed in enumerate(seeds):
        words = [line.cells.get(place, ()) for line in lines]
        left = min([seed.left, *(word.box[0] for own in words for word in own)])
        right = max([seed.right, *(word.box[2] for own in words for word in own)])
        found.append(replace(seed, left=left, right=right, cells=tuple(map(_text, words))))
    for k in range(len(found) - 1):
        a, b = found[k], found[k + 1]
        if a.right > b.left:
            middle = (a.right + b.left) / 2
            found[k], found[k + 1] = replace(a, right=middle), replace(b, left=middle)
    return found


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
