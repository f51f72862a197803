"""Amounts of a page: which occur again, which are sums, and which are parts of sums."""

import pytest

from services.layout.graph.amount_features import AMOUNT_FEATURES, MOST_AMOUNTS, find_amounts, measure_amounts
from services.layout.page import Page, Zone


def page(*texts: str) -> Page:
    zones = (
        Zone(f"z{k}", (10.0, 10.0 + 20 * k, 90.0, 22.0 + 20 * k), text=text) for k, text in enumerate(texts)
    )
    return Page(100.0, 2000.0, tuple(zones))


@pytest.mark.parametrize(
    ("text", "amounts"),
    [
        ("RM1,007.50 SR", [100750]),
        ("1.007,50", [100750]),
        ("2 x 3.00 6.00", [300, 600]),
        ("30.03.2018", []),
        ("3.5 kg, 12.345", []),
        ("Rounding -0.02", [-2]),
        ("- 7.43, 5-10.65", [-743, 1065]),
    ],
)
def test_amounts_have_two_decimals(text: str, amounts: list[int]) -> None:
    assert find_amounts(text) == amounts


def features(*texts: str) -> list[str]:
    """Of each zone the names of its features, their first letters after the colon."""
    receipt = page(*texts)
    short = [name.split(":")[1] for name in AMOUNT_FEATURES]
    return [
        " ".join(name for name, has in zip(short, row, strict=True) if has)
        for row in measure_amounts(receipt, receipt).tolist()
    ]


def test_a_total_is_the_last_sum_and_occurs_again() -> None:
    assert features("82.50", "4.95", "87.45", "Cash 87.45", "Thank you", "82.50 4.95", "0.00") == [
        "again added-below",
        "again added-below",
        "again sum last-sum",
        "again sum last-sum",
        "",
        "",  # two amounts are none
        "",
    ]


def test_of_several_sums_the_last_one_is_told_apart() -> None:
    net, gst, taxed, free, payable = features("12.96", "0.78", "13.74", "39.40", "53.14")
    assert (net, gst, free) == ("added-below", "added-below", "added-below")
    assert (taxed, payable) == ("sum added-below", "sum last-sum")


def test_cash_and_change_do_not_make_a_total_a_part() -> None:
    subtotal, tax, total, cash, change = features("37.74", "2.26", "40.00", "50.00", "10.00")
    assert (subtotal, tax) == ("added-below", "added-below")
    assert total == "sum added-above last-sum"
    assert (cash, change) == ("sum", "added-above")


def test_what_is_taken_off_is_a_part_too() -> None:
    assert features("29.33", "-2.13", "27.20") == ["added-below", "added-below", "sum last-sum"]


def test_no_amount_is_the_double_of_itself() -> None:
    assert features("5.00", "10.00") == ["", ""]


def test_all_print_counts_where_zones_are_some_of_it() -> None:
    below = Page(100.0, 2000.0, (Zone("z1", (10.0, 50.0, 90.0, 62.0), text="87.45"),))
    assert measure_amounts(below, page("82.50", "4.95", "87.45")).tolist() == [[0, 1, 0, 0, 1]]


def test_a_page_of_many_amounts_says_nothing() -> None:
    table = page(*(f"{k}.10" for k in range(MOST_AMOUNTS + 1)))
    assert not measure_amounts(table, table).any()
    assert measure_amounts(Page(10.0, 10.0, ()), Page(10.0, 10.0, ())).shape == (0, 5)
