"""Rows of a page in columns: which words of each row are in which column."""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace

from services.layout.page import Box, ZoneWord
from services.layout.tables.column_evidence import PrintedColumn
from services.layout.tables.print_rows import PrintedRow, Segment
from services.layout.values.kinds import NUMERIC, kind_of

NEXT_ROW = 3.2
"""Farthest next row of a table, in em from middle to middle."""
_NEAR = 1.6
"""How far a cell may be from the print of its column, in em."""
_MOST_COLUMNS = 0.6
"""Share of the columns that a row fills by which they are measured."""


@dataclass(frozen=True, slots=True, eq=False)
class PageRows:
    """The rows of a page from the top down, the parts that wide spaces make of each, and the font size in pixels."""

    em: float
    rows: tuple[PrintedRow, ...]
    parts: tuple[list[Segment], ...]

    def below(self, place: int, taken: Set[int]) -> Iterator[int]:
        """Places of the rows below one, up to the first gap or the first one that is taken."""
        last = self.rows[place].middle
        for at in range(place + 1, len(self.rows)):
            if at in taken or self.rows[at].middle - last > NEXT_ROW * self.em:
                return
            yield at
            last = self.rows[at].middle


@dataclass(frozen=True, slots=True, eq=False)
class RowCells:
    """A row in columns: the words of each column by its place; `alien` is print that is in none."""

    place: int
    cells: Mapping[int, tuple[ZoneWord, ...]]
    alien: bool

    def kinds(self) -> dict[int, str]:
        return {column: kind_of(text_of(words)) for column, words in self.cells.items()}


def text_of(words: Sequence[ZoneWord]) -> str:
    return " ".join(word.text for word in words)


def in_columns(
    page: PageRows, seeds: Sequence[PrintedColumn], places: Sequence[int]
) -> tuple[list[PrintedColumn], list[RowCells]]:
    """The columns as wide as their print, and the rows in them."""
    columns = list(seeds)
    for _ in range(2):
        lines = [row_cells(page, place, columns) for place in places]
        usual = [line for line in lines if fills(line, columns)] or lines[:1]
        columns = _widened(seeds, usual)
    return columns, [row_cells(page, place, columns) for place in places]


def row_cells(page: PageRows, place: int, columns: Sequence[PrintedColumn]) -> RowCells:
    """The words of a row by column: whole parts where they lie in one column, else word by word."""
    cells: dict[int, list[ZoneWord]] = {}
    alien = False
    for part in page.parts[place]:
        over = [k for k, column in enumerate(columns) if overlap(part.box, _span(column)) > 0]
        if len(over) == 1:
            cells.setdefault(over[0], []).extend(part.words)
            continue
        for word in part.words:
            nearest = min(range(len(columns)), key=lambda k: _distance(word.box, columns[k]))
            if over or _distance(word.box, columns[nearest]) < _NEAR * page.em:
                cells.setdefault(nearest, []).append(word)
            else:
                alien = True
    return RowCells(place, {k: tuple(words) for k, words in cells.items()}, alien)


def fills(line: RowCells, columns: Sequence[PrintedColumn]) -> bool:
    """Whether a row fills most columns and has a number: what columns are measured by."""
    numbers = sum(kind in NUMERIC for kind in line.kinds().values())
    return not line.alien and len(line.cells) >= _MOST_COLUMNS * len(columns) and numbers >= 1


def _widened(seeds: Sequence[PrintedColumn], lines: Sequence[RowCells]) -> list[PrintedColumn]:
    """The columns as wide as the words of these rows, with the kinds of their cells; none reaches into the next one."""
    found = []
    for place, seed in enumerate(seeds):
        words = [line.cells.get(place, ()) for line in lines]
        left = min([seed.left, *(word.box[0] for own in words for word in own)])
        right = max([seed.right, *(word.box[2] for own in words for word in own)])
        found.append(replace(seed, left=left, right=right, cells=tuple(map(text_of, words))))
    for k in range(len(found) - 1):
        a, b = found[k], found[k + 1]
        if a.right > b.left:
            middle = (a.right + b.left) / 2
            found[k], found[k + 1] = replace(a, right=middle), replace(b, left=middle)
    return found


def overlap(box: Box, other: Box) -> float:
    return min(box[2], other[2]) - max(box[0], other[0])


def _span(column: PrintedColumn) -> Box:
    return column.left, 0.0, column.right, 0.0


def _distance(box: Box, column: PrintedColumn) -> float:
    """From a word to a column, negative where they overlap."""
    return max(column.left - box[2], box[0] - column.right)
