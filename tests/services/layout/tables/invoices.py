"""Made invoices as pages of words, and the tables that samples of them teach."""

from collections.abc import Sequence

import numpy as np

from services.layout.page import Page, Zone, ZoneWord
from services.layout.tables.found_table import FoundTable
from services.layout.tables.learning import TablePage, learn_table, table_page
from services.layout.tables.table_model import TableModel
from simulation.invoice_firms import FIRMS, Firm
from simulation.invoice_pages import ITEMS, InvoicePage, invoice

NORDLICHT, GARNIER, HARBOR, AHRENS, KESSLER, ALDER = (
    next(firm for firm in FIRMS if word in firm.name)
    for word in ("Nordlicht", "Garnier", "Harbor", "Ahrens", "Kessler", "Alder")
)


def made(firm: Firm, seed: int, items: int | None = 6) -> list[InvoicePage]:
    return invoice(firm, np.random.default_rng(seed), items=items, draw=False)


def words_of(page: InvoicePage) -> tuple[ZoneWord, ...]:
    return tuple(ZoneWord(word.text, word.box, 0.99, 0) for word in page.words)


def printed(page: InvoicePage) -> Page:
    """The page with its words alone, as if they were in no zone."""
    return Page(float(page.width), float(page.height), (), words_of(page))


def cell_zones(page: InvoicePage, rows: int = 2, items: Sequence[str] = ITEMS) -> tuple[Zone, ...]:
    """The cells of the first rows as a person labels them."""
    return tuple(
        Zone(f"{k}{label}", row[label].box, label=label, text=row[label].text)  # type: ignore[index]
        for k, row in enumerate(page.rows[:rows])
        for label in items
    )


def labelled(page: InvoicePage, rows: int = 2) -> TablePage:
    return table_page(
        Page(float(page.width), float(page.height), cell_zones(page, rows)), printed(page), ITEMS
    )


def taught(*firms: Firm, samples: int = 2, rows: int = 2, items: int = 6) -> TableModel:
    pages = [labelled(made(firm, seed, items)[0], rows) for firm in firms for seed in range(samples)]
    model = learn_table(pages, ITEMS)
    assert model is not None
    return model


def texts(tables: Sequence[FoundTable]) -> list[dict[str, str]]:
    """The cells of all rows, by label."""
    return [{label: cell.text for label, cell in row.items()} for table in tables for row in table.rows]


def true_texts(page: InvoicePage) -> list[dict[str, str]]:
    return [{label: row[label].text for label in ITEMS} for row in page.rows]
