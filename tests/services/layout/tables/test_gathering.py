"""Tables as one zone each, of segmented pages and of stored ones."""

from dataclasses import replace

import numpy as np
import pytest

from services.layout.page import Page, Zone, ZoneWord
from services.layout.pipeline import fine_page
from services.layout.segmentation import FinePage, compose_page
from services.layout.tables.finding import find_tables
from services.layout.tables.gathering import best_tables, gather_lines, gather_zones
from services.ocr.engine import Word
from simulation.invoice_firms import FIRMS
from simulation.invoice_pages import InvoicePage, invoice
from tests.services.layout.tables.invoices import ALDER, printed, taught

GRID = next(firm for firm in FIRMS if firm.rules == "grid")


@pytest.fixture(scope="module")
def segmented() -> tuple[InvoicePage, Page, FinePage]:
    """A page with a ruled table, segmented with its true words."""
    [page] = invoice(GRID, np.random.default_rng(2), items=5)
    assert page.image is not None
    words = [Word(word.text, word.box, 0.9) for word in page.words]
    return page, *fine_page(np.repeat(page.image[..., None], 3, axis=2), words)


def test_a_table_is_one_zone_and_no_line(segmented: tuple[InvoicePage, Page, FinePage]) -> None:
    truth, page, fine = segmented
    tables = best_tables(page, [taught(GRID)])
    gathered = compose_page(gather_lines(fine, tables))
    top, bottom = truth.rows[0]["amount"].box[1], truth.rows[-1]["amount"].box[3]
    inside = [zone for zone in gathered.zones if top <= (zone.box[1] + zone.box[3]) / 2 <= bottom]
    [table] = inside
    assert table.text.splitlines()[0] == "QTY ITEM # DESCRIPTION PRICE EACH LINE TOTAL"
    assert table.lines == 6
    assert len(page.zones) > len(gathered.zones) + 10
    # Nothing is lost: what is printed outside is where it was.
    outside = {zone.text for zone in page.zones if zone.box[3] < table.box[1] or zone.box[1] > table.box[3]}
    assert outside <= {zone.text for zone in gathered.zones}


def test_words_that_no_zone_has_are_kept(segmented: tuple[InvoicePage, Page, FinePage]) -> None:
    """The sign # stands alone; segmentation knows no line of signs."""
    _, page, _ = segmented
    assert "#" in {word.text for word in page.loose}
    assert "#" not in {word.text for zone in page.zones for word in zone.words}


def test_without_tables_a_page_stays_the_same_object(segmented: tuple[InvoicePage, Page, FinePage]) -> None:
    _, page, fine = segmented
    assert gather_lines(fine, ()) is fine
    assert gather_zones(page, ()) is page


def test_a_zone_that_reaches_out_of_a_table_keeps_its_other_words() -> None:
    [page] = invoice(ALDER, np.random.default_rng(2), items=3, draw=False)
    plain = printed(page)
    tables = find_tables(plain, taught(ALDER))
    amounts = [word for word in plain.loose if word.box[0] > 1000 and 400 < word.box[1] < 800]
    column = Zone(
        "z1",
        (1000.0, 400.0, 1130.0, 800.0),
        text="\n".join(word.text for word in amounts),
        words=tuple(ZoneWord(word.text, word.box, 0.9, k) for k, word in enumerate(amounts)),
    )
    others = tuple(word for word in plain.loose if word not in amounts)
    left, table = gather_zones(replace(plain, zones=(column,), loose=others), tables).zones
    assert left.text.splitlines() == [word.text for word in amounts[-3:]]
    assert left.lines == 3
    assert left.box[1] >= table.box[3]
    assert "Amount" in table.text
