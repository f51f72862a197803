"""Numbers of cells, and columns of which one is the product of two others."""

from decimal import Decimal

import pytest

from services.layout.tables.cell_numbers import number_of
from services.layout.tables.column_products import count_products, fits_product, product_rule
from services.layout.tables.table_model import TableModel
from tests.services.layout.tables.invoices import ALDER, taught


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("1,234.50", "1234.50"),
        ("1.234,50 €", "1234.50"),
        ("12 345,6", "12345.6"),
        ("CHF 1'234.50", "1234.50"),
        ("$4", "4"),
        ("0.125", "0.125"),
        ("1.250", "1250"),
        ("-3,5", "-3.5"),
        ("19 %", "19"),
        ("7.", "7"),
    ],
)
def test_numbers_of_many_countries(text: str, number: str) -> None:
    assert number_of(text) == Decimal(number)


@pytest.mark.parametrize("text", ["", "Oak", "25 m x 3", "12/05/2024", "-", "..,"])
def test_no_number_or_several(text: str) -> None:
    assert number_of(text) is None


def test_a_product_may_be_rounded_and_not_wrong() -> None:
    assert fits_product(Decimal("3"), Decimal("0.333"), Decimal("1.00"))
    assert not fits_product(Decimal("3"), Decimal("4.10"), Decimal("12.40"))


def test_samples_show_which_column_is_the_product() -> None:
    rule = product_rule(taught(ALDER))
    assert rule is not None
    assert ({rule.of, rule.by}, rule.gives) == ({"quantity", "price"}, "amount")
    assert rule.fits == rule.tested >= 8


def test_rows_with_one_piece_tell_nothing_and_one_row_is_no_rule() -> None:
    one_piece = [{"quantity": "1", "price": "5.00", "amount": "5.00"}] * 5
    labels = ("quantity", "price", "amount")
    assert count_products(one_piece, labels, ()) == ()
    once = count_products([{"quantity": "2", "price": "5.00", "amount": "10.00"}], labels, ())
    assert product_rule(TableModel((), products=once)) is None
