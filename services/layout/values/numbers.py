"""Numbers: amounts of money and whole numbers, as texts that every language reads as numbers."""

import re
from collections.abc import Iterator

from services.contract.fields import FieldSetting
from services.layout.values.found import FoundValue, the_only

_SPACE = "\u00a0\u202f "
_BETWEEN = rf"[.,'’{_SPACE}]"
# Groups of two digits are Indian: 1,00,000.
_GROUPED = rf"\d{{1,3}}(?:{_BETWEEN}\d{{2,3}}){{0,5}}{_BETWEEN}\d{{3}}(?!\d)|\d{{1,15}}"
_SIGN = "[-−–]"
_WHOLE = re.compile(rf"(?<![\w.,])({_SIGN}?)({_GROUPED})(?![\w]|[.,]\d)")
_CODE = r"[A-Z]{3}|[^\W\d_]{0,3}[$€£¥₹₽₺₩₪₫₴฿]|[Kk]r\.?|Rs\.?|Fr\.|z[łl]"
_AMOUNT = re.compile(
    rf"(?P<minus>\(|{_SIGN})?(?:(?P<before>{_CODE})\s?)?(?P<inner>{_SIGN})?(?<!\d)"
    rf"(?P<number>(?:{_GROUPED})(?:[.,]\d{{1,2}}(?!\d))?)\s?(?P<after>{_CODE})?(?![\w])"
)
_CURRENCIES = {"€": "EUR", "£": "GBP", "₹": "INR", "₽": "RUB", "₺": "TRY", "₩": "KRW", "₪": "ILS", "₫": "VND"}
_CURRENCIES |= {"₴": "UAH", "฿": "THB", "US$": "USD", "zł": "PLN", "zl": "PLN"}
_SHARED = {
    "$": {"USD", "CAD", "AUD", "NZD", "HKD", "SGD", "MXN", "ARS", "CLP", "COP", "BRL"},
    "¥": {"JPY", "CNY"},
    "kr": {"SEK", "NOK", "DKK", "ISK"},
    "rs": {"INR", "PKR", "LKR", "NPR"},
    "fr": {"CHF", "XAF", "XOF"},
    "£": {"GBP", "EGP", "GIP"},
}
"""Signs of several currencies: the one of the setting if it is among them."""


def find_integer(text: str, setting: FieldSetting) -> FoundValue:
    """The whole number of a text, digits with a minus sign if it is negative."""
    return the_only(
        FoundValue(("-" if match[1] else "") + _digits(match[2]), match.span())
        for match in _WHOLE.finditer(text)
    )


def _digits(number: str) -> str:
    return str(int(re.sub(r"\D", "", number)))


def find_amount(text: str, setting: FieldSetting) -> FoundValue:
    """The amount of a text, digits with a point before the decimals; of several numbers the one with a currency."""
    found = list(_amounts(text, setting))
    named = [amount for amount, has_currency in found if has_currency]
    return the_only(named or [amount for amount, _ in found])


def _amounts(text: str, setting: FieldSetting) -> Iterator[tuple[FoundValue, bool]]:
    from price_parser import Price

    for match in _AMOUNT.finditer(text):
        if _is_id(text, match):
            continue
        price = Price.fromstring(match["number"], decimal_separator=setting.decimal)
        if price.amount is None:
            continue
        sign = match["before"] or match["after"]
        opened = match["minus"] == "("
        closed = text[match.end() :].lstrip().startswith(")")
        is_negative = match["inner"] is not None or (closed if opened else match["minus"] is not None)
        value = f"{'-' if is_negative else ''}{price.amount:f}"
        yield FoundValue(value, match.span(), _currency(sign, setting.currency)), sign is not None


def _is_id(text: str, match: re.Match[str]) -> bool:
    """Whether a whole number is tied to letters by a hyphen, as in "CHE-151.853.686"; "CHF-32.00" is an amount."""
    tied = match["inner"] is not None and text[: match.start("inner")][-1:].isalpha()
    return tied and re.search(r"[.,]\d{1,2}$", match["number"]) is None


def _currency(sign: str | None, expected: str | None) -> str | None:
    if sign is None:
        return expected
    sign = sign.rstrip(".")
    if len(sign) == 3 and sign.isalpha() and sign.isupper():
        return sign
    return expected if expected in _SHARED.get(sign.lower(), ()) else _CURRENCIES.get(sign)
