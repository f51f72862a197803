"""Words of tables with a grid, cell by cell: what the engine takes for lines may run through several cells."""

from collections.abc import Sequence
from dataclasses import dataclass

from services.contract.boxes import SAME_ROW, Sides, area, common_height, holds_middle
from services.ocr.engine import Word
from services.text.arrangement import is_value, line_of, lines_of, rows_of
from services.text.page_text import ReadLine, TextBlock, is_right_to_left

_SUB_ROWS = 3
"""Lines of two cells beside each other, all level with one another, from which on they may be rows without a rule
between: texts in two cells have a line or two level by chance."""
_REACH = 0.25
"""Heights of a word that it reaches out of its cell, as a box that was measured roughly may."""
_MOST_OUTSIDE = 0.05
"""Of a table's words; a rule through prose has four of five lines' words on both of its sides."""


@dataclass(frozen=True, slots=True)
class RuledTables:
    """Blocks of text of the tables of a page, from the top down, and the words that are in none."""

    blocks: tuple[TextBlock, ...]
    others: tuple[Word, ...]


def read_tables(words: Sequence[Word], tables: Sequence[Sequence[Sides]]) -> RuledTables:
    """The `words` in the cells of `tables`, row by row.

    A row whose cells have a line each is one line, with more lines where one cell goes on; else the lines of each cell
    follow one another. Where cells beside each other have many lines that are level, and values, they are columns of
    rows without rules, and are read across.
    """
    others, blocks = list(words), []
    for cells in tables:
        held, rest = _in_cells(others, cells)
        rows = _rows(held)
        # A frame, or rules of a drawing, is no table; the edge of a shadow runs through words.
        if max(map(len, rows), default=0) > 1 and _hold_their_words(held):
            blocks.append(TextBlock(tuple(line for row in rows for line in _read_row(row))))
            others = rest
    return RuledTables(tuple(blocks), tuple(others))


Cell = tuple[Sides, list[Word]]
Lines = Sequence[ReadLine]


def _hold_their_words(held: Sequence[Cell]) -> bool:
    outside = [
        max(cell[0] - word.box[0], word.box[2] - cell[2]) > _REACH * (word.box[3] - word.box[1])
        for cell, words in held
        for word in words
    ]
    return sum(outside) <= _MOST_OUTSIDE * len(outside)


def _in_cells(words: Sequence[Word], cells: Sequence[Sides]) -> tuple[list[Cell], list[Word]]:
    """The cells with words, and the words whose middle is in none."""
    held: dict[int, list[Word]] = {}
    others = []
    for word in words:
        around = [index for index, cell in enumerate(cells) if holds_middle(cell, word.box)]
        if around:
            held.setdefault(min(around, key=lambda index: area(cells[index])), []).append(word)
        else:
            others.append(word)
    return [(cells[index], held[index]) for index in sorted(held)], others


def _rows(held: Sequence[Cell]) -> list[list[Cell]]:
    """Cells from the top down that begin at one height, within half of the lower one's."""
    rows: list[list[Cell]] = []
    for cell in held:
        (_, top, _, foot), first = cell[0], rows[-1][0][0] if rows else None
        if first is not None and abs(top - first[1]) < 0.5 * min(foot - top, first[3] - first[1]):
            rows[-1].append(cell)
        else:
            rows.append([cell])
    return rows


def _read_row(row: Sequence[Cell]) -> list[ReadLine]:
    words = [word for _, mine in row for word in mine]
    read = [rows_of(lines_of(mine)) for _, mine in row]
    if max(map(len, read)) == 1:
        return [line_of(words)]
    if _goes_on(read) or _has_sub_rows(read):
        return list(rows_of([part for _, mine in row for part in lines_of(mine)]))
    backwards = is_right_to_left("".join(word.text for word in words))
    order = sorted(range(len(row)), key=lambda index: row[index][0][0], reverse=backwards)
    return [line for index in order for line in read[index]]


def _goes_on(read: Sequence[Lines]) -> bool:
    """Whether the text of one cell goes on below a row: the lines of all others are level with its first one."""
    longest = max(read, key=len)
    return all(len(lines) == 1 and _is_level(lines[0], longest[:1]) for lines in read if lines is not longest)


def _has_sub_rows(read: Sequence[Lines]) -> bool:
    """Whether cells have many lines, each level with one of the longest cell, and values in one of them."""
    *fewer, most = sorted((lines for lines in read if len(lines) >= _SUB_ROWS), key=len) or [()]
    level = all(_is_level(line, most) for lines in fewer for line in lines)
    values = any(2 * sum(is_value(line.words) for line in lines) > len(lines) for lines in (*fewer, most))
    return bool(fewer) and level and values


def _is_level(line: ReadLine, others: Lines) -> bool:
    return any(common_height(line.box, other.box) >= SAME_ROW for other in others)
