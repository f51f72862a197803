"""What labelled cells teach: headers, kinds of values, places, and which line has the amount."""

from dataclasses import replace

import pytest

from services.layout.page import Page, Zone
from services.layout.tables.learning import TablePage, gathered_samples, learn_table
from tests.services.layout.tables.invoices import (
    AHRENS,
    ALDER,
    HARBOR,
    KESSLER,
    cell_zones,
    labelled,
    made,
    printed,
    taught,
)

ITEMS = ("description", "quantity", "price", "amount")


def test_the_words_above_a_column_are_its_header() -> None:
    columns = {column.label: column for column in taught(ALDER, samples=3).columns}
    assert dict(columns["description"].headers) == {"description": 3.0}
    assert dict(columns["price"].headers) == {"price": 3.0, "unit": 3.0}
    assert dict(columns["quantity"].headers) == {"qty": 3.0}


def test_the_header_is_found_from_a_row_in_the_middle() -> None:
    [page] = made(AHRENS, 4, 9)
    page = replace(page, rows=page.rows[5:6])
    model = learn_table([labelled(page)], ITEMS)
    assert model is not None
    assert {column.label: set(column.headers) for column in model.columns} == {
        "description": {"bezeichnung"},
        "quantity": {"menge"},
        "price": {"einzelpreis"},
        "amount": {"gesamtpreis"},
    }


def test_rows_that_nobody_labelled_teach_too() -> None:
    model = taught(ALDER, samples=2, rows=1, items=8)
    assert {column.cells for column in model.columns} == {16.0}
    by_label = {column.label: column for column in model.columns}
    assert set(by_label["amount"].kinds) == {"amount"}
    assert set(by_label["quantity"].kinds) == {"integer"}


@pytest.mark.parametrize(("firm", "at_top"), [(HARBOR, True), (KESSLER, False)])
def test_which_line_of_an_item_has_its_amount(firm: object, at_top: bool) -> None:
    model = taught(firm, samples=6, rows=6)  # type: ignore[arg-type]
    assert (model.at_top > 0, model.at_bottom > 0) == (at_top, not at_top)


def test_a_page_more_is_added_to_what_is_known() -> None:
    first, second = (labelled(made(ALDER, seed)[0]) for seed in (1, 2))
    known = learn_table([first], ITEMS)
    grown, whole = learn_table([second], ITEMS, known), learn_table([first, second], ITEMS)
    assert grown is not None
    assert whole is not None
    assert grown.samples == whole.samples == 2
    assert [column.headers for column in grown.columns] == [column.headers for column in whole.columns]


def test_pages_without_cells_teach_nothing() -> None:
    [page] = made(ALDER, 1)
    assert learn_table([TablePage(printed(page), ())], ITEMS) is None
    known = taught(ALDER)
    assert learn_table([TablePage(printed(page), ())], ITEMS, known) == known


def test_an_item_that_is_none_any_more_is_forgotten() -> None:
    model = learn_table([labelled(made(ALDER, 1)[0])], ITEMS[:2], taught(ALDER))
    assert model is not None
    assert model.labels == ITEMS[:2]
    assert model.products == ()


def test_the_graph_sees_a_table_as_one_zone_without_a_label() -> None:
    [page] = made(ALDER, 1)
    total = Zone("t", page.values["total"].box, label="total", text=page.values["total"].text)
    verified = Page(float(page.width), float(page.height), (total, *cell_zones(page)))
    [plain], [found] = gathered_samples([verified], [printed(page)], taught(ALDER))
    assert [zone.label for zone in plain.zones] == ["total", None]
    assert found is not None
    [table] = found.zones
    assert table.text.startswith("Description Qty Unit price Amount\n")
    assert not {word.text for word in found.loose} & {"Qty"}
    assert "Subtotal" in {word.text for word in found.loose}
