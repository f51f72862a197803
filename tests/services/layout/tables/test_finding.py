"""Tables of a page: rows and cells of firms that samples show, and of others."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.layout.page import Page, ZoneWord
from services.layout.tables.finding import find_tables
from services.layout.tables.table_model import TableModel
from simulation.invoice_firms import FIRMS, Firm
from tests.services.layout.tables.invoices import (
    AHRENS,
    ALDER,
    GARNIER,
    HARBOR,
    KESSLER,
    NORDLICHT,
    made,
    printed,
    taught,
    texts,
    true_texts,
    words_of,
)


@pytest.fixture(scope="module")
def of_others() -> TableModel:
    """Of firms in four languages, none of them Nordlicht or Garnier."""
    others = [firm for firm in FIRMS if firm not in (NORDLICHT, GARNIER)]
    return taught(*others, samples=1)


@pytest.mark.parametrize("firm", [ALDER, AHRENS, KESSLER, NORDLICHT], ids=lambda firm: firm.name)
def test_two_samples_of_a_firm_show_its_tables(firm: Firm) -> None:
    model = taught(firm)
    for seed in (21, 22):
        [page] = made(firm, seed, 7)
        assert texts(find_tables(printed(page), model)) == true_texts(page)


def test_the_rows_do_not_include_the_sums_below_them() -> None:
    [page] = made(ALDER, 5, 1)
    [table] = find_tables(printed(page), taught(ALDER))
    assert len(table.rows) == 1
    assert table.box[3] < page.values["total"].box[1]


@pytest.mark.parametrize("firm", [NORDLICHT, GARNIER], ids=lambda firm: firm.name)
def test_a_firm_that_no_sample_shows(firm: Firm, of_others: TableModel) -> None:
    """Its header has other words, and it has a column of discounts, which no sample labels."""
    for seed in (31, 32):
        [page] = made(firm, seed, 5)
        assert texts(find_tables(printed(page), of_others)) == true_texts(page)


def test_lines_of_a_description_go_to_their_item_whether_its_amount_is_above_or_below() -> None:
    for firm in (HARBOR, KESSLER):
        page = next(page for seed in range(40, 50) for page in made(firm, seed, 8))
        found = texts(find_tables(printed(page), taught(firm)))
        assert any("\n" in row["description"] for row in found)
        assert found == true_texts(page)


def test_a_table_goes_on_without_a_header() -> None:
    first, second = made(NORDLICHT, 3, 40)
    model = taught(NORDLICHT)
    before = find_tables(printed(first), model)[-1]
    [table] = find_tables(printed(second), model, before)
    assert table.headers == {}
    assert texts([table]) == true_texts(second)


def test_misread_letters_in_the_header_change_nothing() -> None:
    [page] = made(AHRENS, 8, 5)
    wrong = {"Bezeichnung": "Bezelchnunq", "Menge": "Mcnge", "Gesamtpreis": "Gesaratpreis"}
    words = tuple(replace(word, text=wrong.get(word.text, word.text)) for word in words_of(page))
    tables = find_tables(replace(printed(page), loose=words), taught(AHRENS))
    assert texts(tables) == true_texts(page)


def test_a_slanted_page() -> None:
    """One degree: over the table's width its rows fall by two thirds of the space between them."""
    [page] = made(ALDER, 9, 6)
    words = tuple(
        replace(word, box=tuple(value + (k % 2) * 0.0175 * word.box[0] for k, value in enumerate(word.box)))
        for word in words_of(page)
    )
    assert texts(find_tables(replace(printed(page), loose=words), taught(ALDER))) == true_texts(page)


def test_a_letter_has_no_table() -> None:
    lines = ("Dear Sir,", "we thank you for 12 boxes of 3 May 2024", "and remain 2 friends", "Yours, A. Bell")
    words = tuple(
        ZoneWord(text, (100.0 + 90 * k, 200.0 + 30 * n, 180.0 + 90 * k, 214.0 + 30 * n), 0.9, 0)
        for n, line in enumerate(lines)
        for k, text in enumerate(line.split())
    )
    assert find_tables(Page(1240.0, 1754.0, (), words), taught(ALDER)) == ()


def test_a_page_that_was_not_read_has_none() -> None:
    assert find_tables(Page(100.0, 100.0, ()), taught(ALDER)) == ()


word = st.builds(
    lambda text, x, y, w, h: ZoneWord(text, (x, y, x + w, y + h), 0.9, 0),
    st.sampled_from(("Qty", "Amount", "12", "3.50", "£4", "Oak", "%", "Unit", "price", "19", "1,000.00")),
    *(st.floats(0, 900), st.floats(0, 400)),
    *(st.floats(1, 200), st.floats(1, 40)),
)


@given(st.lists(word, max_size=40))
def test_of_any_words_each_is_in_one_cell_at_most(words: list[ZoneWord]) -> None:
    tables = find_tables(Page(1000.0, 500.0, (), tuple(words)), MODEL)
    for table in tables:
        cells = [cell for row in table.rows for cell in row.values()]
        assert sum(len(cell.words) for cell in cells) <= len(words)
        assert all(cell.words and set(cell.words) <= set(table.words) for cell in cells)
        x0, y0, x1, y1 = table.box
        assert all(x0 <= c.box[0] and y0 <= c.box[1] and c.box[2] <= x1 and c.box[3] <= y1 for c in cells)


MODEL = taught(ALDER)


def test_one_item_without_a_header_is_found_by_its_product() -> None:
    """And not where its numbers say nothing: a text, a small number and two like amounts are no proof."""
    model = taught(ALDER, samples=3)
    found = {}
    for seed in (50, 51, 52, 53):
        [page] = made(ALDER, seed, 1)
        top = min(cell.box[1] for cell in page.rows[0].values())
        rest = tuple(word for word in words_of(page) if word.box[3] > top or word.box[3] < top - 100)
        is_one = page.rows[0]["quantity"].text == "1"
        found[is_one] = texts(find_tables(Page(page.width, page.height, (), rest), model))
        assert found[is_one] == ([] if is_one else true_texts(page))
    assert found.keys() == {True, False}
