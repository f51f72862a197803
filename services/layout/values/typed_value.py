"""From the text of a field to its value, by the type that the settings of the class give to its label."""

from collections.abc import Callable, Mapping

from services.contract.bounded_patterns import LONGEST_TEXT, compile_bounded
from services.contract.fields import FieldSetting, FieldType
from services.layout.values.contacts import find_email, find_phone, find_postal_code
from services.layout.values.dates import find_date
from services.layout.values.found import NO_VALUE, FoundValue, the_only
from services.layout.values.numbers import find_amount, find_integer

_FINDERS: Mapping[FieldType, Callable[[str, FieldSetting], FoundValue]] = {
    "date": find_date,
    "amount": find_amount,
    "integer": find_integer,
    "email": find_email,
    "phone": find_phone,
    "postal-code": find_postal_code,
}


def plain_text(text: str) -> str:
    """The text with single spaces between words, and without empty lines."""
    return "\n".join(line for each in text.splitlines() if (line := " ".join(each.split())))


def find_value(text: str, setting: FieldSetting) -> FoundValue:
    """The value of a field; `text` is its `plain_text`, to which the span of the value refers.

    Other types than `text` search the first `LONGEST_TEXT` characters. Patterns see the lines, all others one line.
    """
    line = text.replace("\n", " ")
    if setting.type == "text":
        return FoundValue(line, (0, len(line))) if line else NO_VALUE
    if setting.type == "pattern":
        return _find_pattern(text[:LONGEST_TEXT], setting)
    return _FINDERS[setting.type](line[:LONGEST_TEXT], setting)


def _find_pattern(text: str, setting: FieldSetting) -> FoundValue:
    pattern = compile_bounded(setting.pattern or "")
    group = 1 if pattern.groups else 0
    matches = (match for match in pattern.finditer(text) if match[group])
    return the_only(FoundValue(match[group].replace("\n", " "), match.span(group)) for match in matches)
