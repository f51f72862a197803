"""What the samples of a class teach of its table of items, as plain values: sums, so that pages can be added."""

from collections.abc import Mapping
from dataclasses import dataclass, field

MOST_HEADER_WORDS = 60
"""Of a column: twenty firms of four languages have half as many. The rarest ones are left out."""
MOST_PRODUCTS = 40

Sums = tuple[float, float, float]
"""Number, sum and sum of squares."""


@dataclass(frozen=True, slots=True)
class ColumnModel:
    """A column by its label: what is printed above it, what its cells look like, and where it is.

    `samples` is how many pages had it, `cells` how many cells were seen in `rows` rows of these pages. `headers` counts
    the pages with a word in the column's header, `kinds` the cells of each kind of value (`values.kinds.kind_of`).
    `left` and `right` are sums of its edges as shares of the page's width, `sizes` those of common logarithms of its
    numbers.
    """

    label: str
    samples: float = 0.0
    cells: float = 0.0
    rows: float = 0.0
    headers: Mapping[str, float] = field(default_factory=dict)
    kinds: Mapping[str, float] = field(default_factory=dict)
    left: Sums = (0.0, 0.0, 0.0)
    right: Sums = (0.0, 0.0, 0.0)
    sizes: Sums = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class ProductRule:
    """How often the cell of column `of` times that of `by` was that of `gives`, of `tested` rows.

    Rows in which one factor is 1 test nothing.
    """

    of: str
    by: str
    gives: str
    tested: float
    fits: float


@dataclass(frozen=True, slots=True)
class TableModel:
    """The table of a class: its columns in the order of the settings `items`.

    `at_top` and `at_bottom` count rows of several lines whose other cells are on the first and on the last one.
    """

    columns: tuple[ColumnModel, ...]
    samples: float = 0.0
    at_top: float = 0.0
    at_bottom: float = 0.0
    products: tuple[ProductRule, ...] = ()

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(column.label for column in self.columns)
