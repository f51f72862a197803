"""Values of cells, and checks of their numbers that make them surer or less sure."""

from dataclasses import replace
from decimal import Decimal

import pytest

from services.contract.fields import FieldSetting
from services.layout.page import Page, ZoneWord
from services.layout.tables.item_table import ItemTable
from services.layout.tables.reading import TablePlan, read_tables
from tests.services.layout.tables.invoices import AHRENS, NORDLICHT, made, printed, taught, words_of

TYPES = {
    "quantity": FieldSetting("amount"),
    "price": FieldSetting("amount", currency="EUR"),
    "amount": FieldSetting("amount", currency="EUR"),
}


@pytest.fixture(scope="module")
def plan() -> TablePlan:
    return TablePlan(taught(AHRENS), TYPES, 0.98)


def read(words: tuple[ZoneWord, ...], plan: TablePlan) -> ItemTable:
    [[table]] = read_tables([Page(1240.0, 1754.0, (), words)], [plan])
    return table


def with_text(words: tuple[ZoneWord, ...], old: str, new: str) -> tuple[ZoneWord, ...]:
    assert sum(word.text == old for word in words) == 1
    return tuple(replace(word, text=new) if word.text == old else word for word in words)


def test_values_have_the_types_of_the_settings(plan: TablePlan) -> None:
    [page] = made(AHRENS, 12, 5)
    table = read(words_of(page), plan)
    assert table.columns == ("description", "quantity", "price", "amount")
    assert table.types == ("text", "amount", "amount", "amount")
    assert table.headers == ("Bezeichnung", "Menge", "Einzelpreis", "Gesamtpreis")
    found = [[cell and cell.value for cell in row] for row in table.rows]
    assert found == [[row[label].value for label in table.columns] for row in page.rows]  # type: ignore[index]
    assert table.rows[0][3] is not None
    assert table.rows[0][3].currency == "EUR"
    assert table.checks.products_fit is True
    assert table.checks.sum_fits is True


def test_a_wrong_product_is_named_and_its_cells_are_less_sure(plan: TablePlan) -> None:
    [page] = made(AHRENS, 12, 5)
    words = words_of(page)
    right = read(words, plan)
    wrong = read(with_text(words, page.rows[2]["price"].text, "7.777,77"), plan)
    assert wrong.checks.unlike == (2,)
    assert wrong.checks.products_fit is False
    for column in (1, 2):
        before, after = right.rows[2][column], wrong.rows[2][column]
        assert before is not None
        assert after is not None
        assert after.confidence < before.confidence - 0.1
    assert right.rows[1] == wrong.rows[1]
    # Its amount is surer than the others: the column adds up.
    assert wrong.rows[2][3] is not None
    assert wrong.rows[2][2] is not None
    assert wrong.rows[2][3].confidence > wrong.rows[2][2].confidence + 0.1


def test_amounts_that_do_not_add_up(plan: TablePlan) -> None:
    [page] = made(AHRENS, 12, 5)
    words = words_of(page)
    below = [word for word in words if word.box[1] > page.rows[-1]["amount"].box[3] and word.box[1] < 1600]
    left_out = tuple(word for word in words if word not in below)
    assert read(left_out, plan).checks.sum_fits is None
    amounts = [word for word in below if "," in word.text]
    other = tuple(replace(word, text="1,23") if word in amounts else word for word in words)
    assert read(other, plan).checks.sum_fits is False
    # Only a tax and the total are printed: the sum is between them.
    without_net = tuple(word for word in words if word != amounts[0])
    assert read(without_net, plan).checks.sum_fits is True
    # What is half of the sum is no tax: it may be an item that was not found.
    net = sum(Decimal(row["amount"].value) for row in page.rows)
    shown = {
        word: f"{number:.2f}".replace(".", ",")
        for word, number in zip(amounts[1:], (net / 2, net * 3 / 2), strict=True)
    }
    half = tuple(replace(word, text=shown.get(word, word.text)) for word in without_net)
    assert read(half, plan).checks.sum_fits is None


@pytest.mark.parametrize(("share", "fits"), [("0.1", True), ("0.45", None)])
def test_a_discount_on_the_sum(plan: TablePlan, share: str, fits: bool | None) -> None:
    """Printed without a sign, as a tax is; one of half of the sum may be an item that was read twice."""
    [page] = made(AHRENS, 12, 5)
    words = words_of(page)
    below = [word for word in words if word.box[1] > page.rows[-1]["amount"].box[3] and word.box[1] < 1600]
    amounts = [word for word in below if "," in word.text]
    net = sum((Decimal(row["amount"].value) for row in page.rows), Decimal(0))
    part = round(net * Decimal(share), 2)
    shown = {
        word: f"{number:.2f}".replace(".", ",")
        for word, number in zip(amounts, (part, net - part, Decimal("1.23")), strict=True)
    }
    changed = tuple(replace(word, text=shown.get(word, word.text)) for word in words)
    assert read(changed, plan).checks.sum_fits is fits


@pytest.mark.parametrize(("amount", "unlike"), [("585,00", False), ("595,00", True)])
def test_one_times_a_price_is_the_price(plan: TablePlan, amount: str, unlike: bool) -> None:
    [page] = made(AHRENS, 12, 5)
    words = words_of(page)
    texts = [word.text for word in words]
    number = next(k for k, row in enumerate(page.rows) if texts.count(row["quantity"].text) == 1)
    for label, text in (("quantity", "1"), ("price", "585,00"), ("amount", amount)):
        words = with_text(words, page.rows[number][label].text, text)
    table = read(words, plan)
    assert table.checks.unlike == ((number,) if unlike else ())
    assert table.checks.products_fit is not unlike


def test_a_discount_is_no_error() -> None:
    plan = TablePlan(taught(NORDLICHT, AHRENS), TYPES, 1.0)
    [page] = made(NORDLICHT, 5, 6)
    assert any(row["discount"].value != "0" for row in page.rows)
    table = read(words_of(page), plan)
    assert table.checks.products_fit is True


def test_the_sum_is_that_of_all_pages(plan: TablePlan) -> None:
    pages = made(AHRENS, 2, 40)
    assert len(pages) == 2
    tables = read_tables([printed(page) for page in pages], [plan, plan])
    assert [len(own[0].rows) for own in tables] == [len(page.rows) for page in pages]
    assert [own[0].checks.sum_fits for own in tables] == [True, True]


def test_a_page_without_a_plan_has_no_tables(plan: TablePlan) -> None:
    [page] = made(AHRENS, 12, 5)
    assert read_tables([printed(page)], [None]) == [()]
