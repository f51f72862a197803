"""Dates: numeric ones and ones with the name of a month, in many languages, to ISO 8601."""

import re
from collections.abc import Iterator, Sequence
from datetime import date

from services.contract.fields import DateOrder, FieldSetting
from services.layout.values.found import FoundValue, the_only

LANGUAGES = ("en", "de", "fr", "es", "it", "nl", "pt")
"""Languages of month names if the setting names none. Each one takes 20 to 100 ms to load, once in a process."""
MOST_CANDIDATES = 12
"""Places of a text that are read as a date; one takes 2 ms. A date's zone has one or two."""

_NUMERIC = re.compile(r"(?<![\w./-])(\d{1,4})\s?([./-])\s?(\d{1,2})\s?\2\s?(\d{1,4})(?![\w/-]|\.\d)")
_MONTH = r"[^\W\d_]{3,12}"
_NAMED = re.compile(
    r"(?<!\w)(?:"
    rf"\d{{1,2}}(?:\.|st|nd|rd|th|er|º|°)?[\s-]{{0,2}}(?:(?:de|of)\s)?{_MONTH}[.,]{{0,2}}[\s-]{{0,2}}(?:(?:de|del)\s)?'?\d{{2,4}}"
    rf"|{_MONTH}\.?\s{{0,2}}\d{{1,2}}(?:st|nd|rd|th)?\s{{0,2}}[.,]{{0,2}}\s{{0,2}}'?\d{{4}}"
    # A number before the date is no year where a year follows.
    rf"|\d{{4}}[,\s]\s?{_MONTH}\.?\s\d{{1,2}}(?!(?:st|nd|rd|th)?\s{{0,2}}[.,]{{0,2}}\s{{0,2}}'?\d{{4}}(?!\w))"
    r")(?!\w)"
)


def find_date(text: str, setting: FieldSetting) -> FoundValue:
    """The date of a text, `YYYY-MM-DD`; a day, a month and a year are needed.

    A numeric date without `setting.order` that is one day by one order and another by the other is `ambiguous`.
    """
    return the_only(_dates(text, setting))


def _dates(text: str, setting: FieldSetting) -> Iterator[FoundValue]:
    languages = setting.languages or LANGUAGES
    for place, match in enumerate(_candidates(text)):
        if place == MOST_CANDIDATES:
            return
        days = {_parse(_plain(match), languages, order) for order in _orders(match, setting.order)}
        days.discard(None)
        if len(days) > 1:
            yield FoundValue(None, match.span(), problem="ambiguous")
        for day in days if len(days) == 1 else ():
            assert day is not None
            yield FoundValue(day.isoformat(), match.span())


def _candidates(text: str) -> Iterator[re.Match[str]]:
    yield from sorted((*_NUMERIC.finditer(text), *_NAMED.finditer(text)), key=lambda match: match.start())


def _orders(match: re.Match[str], order: DateOrder | None) -> tuple[DateOrder, ...]:
    if match.re is _NAMED:
        return ("DMY",)
    if len(match[1]) == 4:
        return ("YMD",)
    return ("DMY", "MDY") if order is None else (order,)


def _plain(match: re.Match[str]) -> str:
    """The date without spaces in numbers, or with one sign between its parts, as the parser takes it."""
    if match.re is _NUMERIC:
        return match[2].join((match[1], match[3], match[4]))
    return re.sub(r"[\s,º°-]+", " ", match[0])


def _parse(text: str, languages: Sequence[str], order: DateOrder) -> date | None:
    # The library and its languages are loaded only where a class has a date.
    import dateparser

    found = dateparser.parse(
        text,
        languages=list(languages),
        settings={"DATE_ORDER": order, "STRICT_PARSING": True, "PARSERS": ["absolute-time"]},
    )
    return None if found is None else found.date()
