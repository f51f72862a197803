"""Values in texts: what each type reads, what it refuses, and that hostile texts take a bounded time."""

import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.contract.fields import FieldSetting, FieldType
from services.layout.values.typed_value import find_value, plain_text

TYPES: tuple[FieldType, ...] = ("date", "amount", "integer", "email", "phone", "postal-code")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("March 3, 1998", "1998-03-03"),
        ("Monday, March 3rd, 1998 at noon", "1998-03-03"),
        ("Mar 3,1998", "1998-03-03"),
        ("May 4 , 1999", "1999-05-04"),
        ("12-MAR-1998", "1998-03-12"),
        ("1998, March 12", "1998-03-12"),
        ("Our ref: LD/6958\nOctober 25, 1983", "1983-10-25"),
        ("No. 1234 May 3rd 2020", "2020-05-03"),
        ("Datum: 3. März 2024", "2024-03-03"),
        ("Paris, le 1er mars 1998", "1998-03-01"),
        ("3 de marzo de 1998", "1998-03-03"),
        ("1998-03-12", "1998-03-12"),
        ("13/03/2024", "2024-03-13"),
        ("03/03/2024", "2024-03-03"),
        ("seen on 03.03.2024.", "2024-03-03"),
    ],
)
def test_dates_of_many_kinds(text: str, value: str) -> None:
    assert find_value(text, FieldSetting("date")).value == value


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("12/03/2024", "ambiguous"),
        ("March 3, 1998 (revised March 5, 1998)", "several-values"),
        ("January 1998", "no-value"),
        ("June 31, 1999", "no-value"),
        ("Tel. 617-253-1000", "no-value"),
        ("05.22.95.66.66", "no-value"),
        ("192.168.12.15", "no-value"),
    ],
)
def test_a_text_without_one_date_has_no_value(text: str, problem: str) -> None:
    found = find_value(text, FieldSetting("date"))
    assert (found.value, found.problem) == (None, problem)


def test_the_order_decides_numeric_dates() -> None:
    assert find_value("12/03/2024", FieldSetting("date", order="MDY")).value == "2024-12-03"
    assert find_value("12.03.24", FieldSetting("date", order="DMY")).value == "2024-03-12"


@pytest.mark.parametrize(
    ("text", "value", "currency"),
    [
        ("Item 3 costs $1,234.56", "1234.56", "USD"),
        ("1.234,56 €", "1234.56", "EUR"),
        ("CHF 1'234.50", "1234.50", "CHF"),
        ("Total: 1 234,50 kr", "1234.50", None),
        ("Rs. 1,00,000.00", "100000.00", None),
        ("(1,200.00)", "-1200.00", "USD"),
        ("$ -12", "-12", "USD"),
        ("CHF-32.00", "-32.00", "CHF"),
        ("CHE-151.853.686 MWST", None, None),
        ("12,50 and 13,00", None, None),
    ],
)
def test_amounts_of_many_countries(text: str, value: str | None, currency: str | None) -> None:
    found = find_value(text, FieldSetting("amount", currency="USD"))
    assert (found.value, found.currency) == (value, currency)


def test_the_decimal_sign_decides_an_amount() -> None:
    assert find_value("1.234", FieldSetting("amount", decimal=".")).value == "1.234"
    assert find_value("1.234", FieldSetting("amount", decimal=",")).value == "1234"


@pytest.mark.parametrize(
    ("text", "value"), [("page 7", "7"), ("1.234.567", "1234567"), ("-5", "-5"), ("3.5", None), ("a12", None)]
)
def test_whole_numbers(text: str, value: str | None) -> None:
    assert find_value(text, FieldSetting("integer")).value == value


def test_people_are_reached() -> None:
    mail = find_value("Mail: John.Doe@Example.COM.", FieldSetting("email"))
    assert mail.value == "John.Doe@example.com"
    assert find_value("a@b", FieldSetting("email")).problem == "no-value"
    american = FieldSetting("phone", region="US")
    assert find_value("Tel. 617.253.1000 / (617) 253-1000", american).value == "+16172531000"
    assert find_value("+49 30 123456", FieldSetting("phone")).value == "+4930123456"
    assert find_value("617 253 1000", FieldSetting("phone")).problem == "no-value"
    assert find_value("Cambridge MA 02139", FieldSetting("postal-code", region="US")).value == "02139"
    assert find_value("London sw1a 1aa", FieldSetting("postal-code", region="GB")).value == "SW1A 1AA"
    assert find_value("12345", FieldSetting("postal-code", region="ZZ")).problem == "no-value"


def test_a_pattern_finds_its_first_group() -> None:
    numbered = FieldSetting("pattern", pattern=r"(?:INV|RE)-([0-9]{4})")
    found = find_value("Our reference INV-1234, again INV-1234", numbered)
    assert (found.value, found.span) == ("1234", (18, 22))
    assert find_value("INV-1234 or RE-1235", numbered).problem == "several-values"


def test_a_pattern_sees_the_lines() -> None:
    lines = plain_text("TO:\n Ms.  Patricia Hall \n\nFAX: 1")
    assert lines == "TO:\nMs. Patricia Hall\nFAX: 1"
    name = FieldSetting("pattern", pattern=r"TO:\s?([A-Za-z. ]++)")
    assert find_value(lines, name).value == "Ms. Patricia Hall"
    assert find_value(lines, FieldSetting("pattern", pattern="(?m)^FAX: [0-9]")).span == (22, 28)
    assert find_value(lines, FieldSetting("pattern", pattern=r"Hall\sFAX")).value == "Hall FAX"


def test_text_is_one_line() -> None:
    assert find_value(plain_text(" Mr. John\n Doe "), FieldSetting()).value == "Mr. John Doe"


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(TYPES), st.text(st.sampled_from("0123456789/.,-+( @aMrch€$"), max_size=60))
def test_the_span_of_a_value_has_the_value(kind: FieldType, text: str) -> None:
    """What is cut out of the text by the span is read as the same value again."""
    setting = FieldSetting(kind, region="US", order="DMY")
    found = find_value(text, setting)
    if found.value is None:
        assert found.problem is not None
    elif kind != "integer":  # a minus sign before a currency is outside of no other number's span
        assert find_value(text[slice(*found.span)], setting).value is not None


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("part", ["1 ", "1.1.", "a.1@", "12 March ", "(617) ", "$1,"])
def test_hostile_texts_take_a_bounded_time(kind: FieldType, part: str) -> None:
    setting = FieldSetting(kind, region="US")
    find_value("March 3, 1998 a@b.org", setting)  # loads the library
    started = time.process_time()
    find_value(part * 100_000, setting)
    assert time.process_time() - started < 0.5
