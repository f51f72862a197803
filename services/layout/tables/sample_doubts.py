"""What is doubtful in the labelled cells of samples: said when the table of a class is learned."""

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise

from services.contract.boxes import SAME_ROW, common_height, holds_middle
from services.layout.page import Box
from services.layout.tables.learning import TablePage, labelled_rows
from services.layout.tables.print_rows import em_of, page_words, printed_rows, segments_of
from services.layout.values.kinds import NUMERIC, kind_of
from services.notices import Notice


def cells_of_several(page: TablePage) -> list[bool]:
    """Of each cell of a page whether its box holds print of a table: rows of several parts, or of one number each.

    The lines of one cell have one part each, and of its numbers only one stands alone in a line.
    """
    words = page_words(page.printed)
    em = em_of(words)

    def is_of_several(box: Box) -> bool:
        rows = printed_rows(word for word in words if holds_middle(box, word.box))
        parts = [segments_of(row, em) for row in rows]
        parted = sum(len(row) > 1 for row in parts)
        numbers = sum(len(row) == 1 and kind_of(row[0].text) in NUMERIC for row in parts)
        return max(parted, numbers) > 1

    return [is_of_several(box) for _, box in page.cells]


def doubts_of_samples(pages: Sequence[TablePage], items: Sequence[str]) -> list[Notice]:
    """Columns that no sample has, labels of columns that are used elsewhere, and two cells of a column in a line."""
    having, alone = Counter[str](), Counter[str]()
    for page in pages:
        having.update({label for label, _ in page.cells})
    for page in pages:
        if len(having) > 1:  # where one column has cells at all, each is alone in its row
            alone.update({label for row in labelled_rows(page) if len(row) == 1 for label in row})
    found = [
        Notice(
            "column-without-cells",
            f"items: no sample has a cell of {label!r}, so that no table has this column. Label cells of it, or leave "
            "it out.",
        )
        for label in items
        if not having[label]
    ]
    found += [
        Notice(
            "column-outside-rows",
            f"items: {alone[label]} of {having[label]} samples have {label!r} where no other cell is in its row. A "
            "label of a column is none of other zones: give these another one.",
        )
        for label in items
        if 2 * alone[label] > having[label]
    ]
    wide = Counter(
        label
        for page in pages
        for label in dict.fromkeys(
            label for (label, _), several in zip(page.cells, cells_of_several(page), strict=True) if several
        )
    )
    found += [
        Notice(
            "several-cells-in-box",
            f"{count} of the pages have a box labelled {label!r} that holds several cells, which are learned as one. "
            "Draw a box around each cell; those of one or two rows are enough.",
        )
        for label, count in wide.items()
    ]
    return [*found, *doubts_of_rows(pages)]


def doubts_of_rows(pages: Iterable[TablePage]) -> list[Notice]:
    """Two cells of one column in one line of a page."""
    doubled = Counter(label for page in pages for label in _doubled(page.cells))
    return [
        Notice(
            "two-cells-in-line",
            f"{count} of the pages have two cells of the column {label!r} in one line, which are learned as two rows. "
            "Draw one box around both, or give one of them another label.",
        )
        for label, count in doubled.items()
    ]


def _doubled(cells: Sequence[tuple[str, Box]]) -> set[str]:
    """The labels of two cells of a page in one line."""
    ordered = sorted(cells, key=lambda cell: (cell[0], cell[1][1] + cell[1][3]))
    return {
        a for (a, box), (b, other) in pairwise(ordered) if a == b and common_height(box, other) > SAME_ROW
    }
