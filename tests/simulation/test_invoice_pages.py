"""Invoices of invented firms: their truth agrees with itself and with what is drawn."""

from decimal import Decimal

import numpy as np
import pytest

from simulation.invoice_firms import FIRMS, Firm
from simulation.invoice_pages import ITEMS, VALUES, InvoicePage, firm_of, invoice


def pages_of(firm: Firm, seed: int = 3, items: int = 6, draw: bool = False) -> list[InvoicePage]:
    return invoice(firm, np.random.default_rng(seed), items=items, draw=draw)


@pytest.mark.parametrize("firm", FIRMS, ids=lambda firm: firm.name)
def test_every_firm_prints_its_values_and_items(firm: Firm) -> None:
    pages = pages_of(firm, items=40)
    assert {label for page in pages for label in page.values} == set(VALUES)
    rows = [row for page in pages for row in page.rows]
    assert len(rows) == 40
    assert all(set(ITEMS) <= set(row) for row in rows)
    total = sum(Decimal(row["amount"].value) for row in rows)
    tax = (total * firm.tax_percent / 100).quantize(Decimal("0.01"))
    assert abs(total + tax - Decimal(pages[-1].values["total"].value)) <= Decimal("0.01")
    if not any(column.kind == "discount" for column in firm.columns):
        for row in rows:
            product = Decimal(row["quantity"].value) * Decimal(row["price"].value)
            assert abs(product - Decimal(row["amount"].value)) <= Decimal("0.005")


def test_boxes_hold_the_words_of_their_text() -> None:
    [page] = pages_of(firm_of("Harbor Point Marine Services"))
    for cell in [*page.values.values(), *(cell for row in page.rows for cell in row.values())]:
        x0, y0, x1, y1 = cell.box
        held = [
            word.text
            for word in page.words
            if word.box[0] >= x0 and word.box[1] >= y0 and word.box[2] <= x1 and word.box[3] <= y1
        ]
        assert sorted(held) == sorted(cell.text.split())


def test_a_seed_decides_the_page_and_drawing_changes_nothing() -> None:
    firm = firm_of("Tischlerei Ahrens GmbH")
    [drawn], [again] = pages_of(firm, draw=True), pages_of(firm)
    assert again.image is None
    assert drawn.image is not None
    assert (drawn.words, drawn.values, drawn.rows) == (again.words, again.values, again.rows)
    ink = np.array([drawn.image[int(y0) : int(y1), int(x0) : int(x1)].min() for x0, y0, x1, y1 in
                    (word.box for word in drawn.words)])  # fmt: skip
    assert (ink < 128).all()
    assert pages_of(firm, seed=4)[0].values != again.values
