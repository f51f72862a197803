"""A table that was found on a page: rows of cells, and where they are."""

from collections.abc import Mapping
from dataclasses import dataclass

from services.layout.page import Box, ZoneWord
from services.layout.tables.print_rows import box_of, printed_rows


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

    `columns` has the edges in pixels of each label that the page has, `headers` what is printed above it; `grid` has
    edges and header of all columns, those without a label too, from left to right; `words` are
    all of the table, those of its header and of columns without a label too. `discounts` are the texts of each row in
    the column of a discount, "" where there is none. `score` is how well it fits.
    """

    rows: tuple[Mapping[str, FoundCell], ...]
    discounts: tuple[str, ...]
    columns: Mapping[str, tuple[float, float]]
    grid: tuple[tuple[float, float, str], ...]
    headers: Mapping[str, str]
    words: tuple[ZoneWord, ...]
    score: float

    @property
    def box(self) -> Box:
        return box_of(self.words)
