"""Amounts of a page: which occur again, which are sums, and which are parts of sums."""

import pytest

from services.layout.graph.amount_features import MOST_AMOUNTS, find_amounts, measure_amounts
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
    ],
)
def test_amounts_have_two_decimals(text: str, amounts: list[int]) -> None:
    assert find_amounts(text) == amounts


def test_a_total_is_a_sum_and_occurs_again() -> None:
    receipt = page("82.50", "4.95", "87.45", "Cash 87.45", "Thank you", "82.50 4.95", "0.00")
    again, total, part = measure_amounts(receipt, receipt).T.tolist()
    assert again == [1, 1, 1, 1, 0, 0, 0], "a zone of two amounts is none"
    assert total == [0, 0, 1, 1, 0, 0, 0]
    assert part == [1, 1, 0, 0, 0, 0, 0]


def test_no_amount_is_the_double_of_itself() -> None:
    twice = page("5.00", "10.00")
    assert not measure_amounts(twice, twice).any()


def test_all_print_counts_where_zones_are_some_of_it() -> None:
    assert measure_amounts(page("87.45"), page("82.50", "4.95", "87.45")).tolist() == [[0, 1, 0]]


def test_a_page_of_many_amounts_says_nothing() -> None:
    table = page(*(f"{k}.10" for k in range(MOST_AMOUNTS + 1)))
    assert not measure_amounts(table, table).any()
    assert measure_amounts(Page(10.0, 10.0, ()), Page(10.0, 10.0, ())).shape == (0, 3)
