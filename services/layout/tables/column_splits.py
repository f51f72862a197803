"""Columns that stand too close to be parted by a space: cut where all rows have numbers on one side."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from services.layout.page import ZoneWord
from services.layout.tables.column_evidence import PrintedColumn
from services.layout.values.kinds import NUMERIC, kind_of

_RIVER = 0.25
"""Least width of what all rows leave free, in em."""
_NEARLY_ALL = 0.8
"""Share of the rows that have a number on one side, and a word on the other."""
_ENOUGH = 3
"""Rows from which on no header needs to show that there are two columns."""


def split_at_numbers(
    columns: Sequence[PrintedColumn],
    rows: Sequence[Mapping[int, Sequence[ZoneWord]]],
    header: Sequence[ZoneWord],
    em: float,
) -> list[PrintedColumn]:
    """The columns, those cut in two that have numbers left or right of a space in all rows.

    `rows` has the words of each row by the column's place, `header` the words above.
    """
    found: list[PrintedColumn] = []
    for place, column in enumerate(columns):
        own = [row[place] for row in rows if place in row]
        above = [word for word in header if column.left <= _middle(word) <= column.right]
        at = _place_of_cut(own, above, em)
        if at is None:
            found.append(column)
            continue
        for left, right in ((column.left, at), (at, column.right)):
            words = [word for cell in (*own, above) for word in cell if left <= _middle(word) < right]
            text = " ".join(word.text for word in above if left <= _middle(word) < right)
            found.append(
                replace(
                    column,
                    left=min(word.box[0] for word in words),
                    right=max(word.box[2] for word in words),
                    header=text,
                )
            )
    return found


def _place_of_cut(cells: Sequence[Sequence[ZoneWord]], header: Sequence[ZoneWord], em: float) -> float | None:
    """The middle of the widest space that parts numbers from words in nearly all cells; None without one."""
    best, widest = None, _RIVER * em
    for left, right in _rivers([*(word for cell in cells for word in cell), *header]):
        at = (left + right) / 2
        sides = [
            [[word.text for word in cell if (_middle(word) < at) == side] for cell in cells]
            for side in (True, False)
        ]
        numbers = [sum(kind_of(" ".join(texts)) in NUMERIC for texts in side if texts) for side in sides]
        words = [sum(any(map(str.isalnum, "".join(texts))) for texts in side) for side in sides]
        enough = _NEARLY_ALL * len(cells)
        is_cut = max(numbers) >= enough and min(words) >= enough
        named = any(_middle(word) < at for word in header) and any(_middle(word) > at for word in header)
        if is_cut and (named or len(cells) >= _ENOUGH) and right - left > widest:
            best, widest = at, right - left
    return best


def _rivers(words: Iterable[ZoneWord]) -> list[tuple[float, float]]:
    """Spaces from left to right that no word covers."""
    rivers: list[tuple[float, float]] = []
    end: float | None = None
    for left, right in sorted((word.box[0], word.box[2]) for word in words):
        if end is not None and left > end:
            rivers.append((end, left))
        end = right if end is None else max(end, right)
    return rivers


def _middle(word: ZoneWord) -> float:
    return (word.box[0] + word.box[2]) / 2
