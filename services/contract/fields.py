"""Types of fields: how the text of a label becomes a value. Settings of a class have one entry for each label."""

from dataclasses import dataclass
from typing import Literal, TypedDict

FieldType = Literal["text", "date", "amount", "integer", "email", "phone", "postal-code", "pattern"]
DateOrder = Literal["DMY", "MDY", "YMD"]
DecimalSign = Literal[".", ","]
ValueProblem = Literal["no-value", "several-values", "ambiguous"]
"""Why a field has no value: the text has none of this type; it has different ones; one can be read in two ways."""

MOST_COLUMNS = 20
"""Columns of a table that a class can name; pages of paper have room for no more."""
MOST_FIELDS = 200
"""Labels of a class with a type; the largest models have 60 labels."""


@dataclass(frozen=True, slots=True)
class FieldSetting:
    """The type of one field. A setting that its type does not use has no effect.

    Parameters
    ----------
    pattern
        Of `pattern`: a regular expression with bounded repetitions. Its first group is the value, or all of it.
    order
        Of `date`: the order of numeric dates. None: those that two orders read differently are `ambiguous`.
    languages
        Of `date`: codes of the languages of month names (ISO 639-1). Empty: seven of Western Europe.
    region
        Of `phone` and `postal-code`: the country of numbers without a country code (ISO 3166-1, two capital letters).
    currency
        Of `amount`: the currency where the text names none, or one of several countries (ISO 4217).
    decimal
        Of `amount`: the decimal sign. None: it follows from the digits.
    """

    type: FieldType = "text"
    pattern: str | None = None
    order: DateOrder | None = None
    languages: tuple[str, ...] = ()
    region: str | None = None
    currency: str | None = None
    decimal: DecimalSign | None = None


class FieldSettingJson(TypedDict):
    """A `FieldSetting` as it is stored."""

    type: FieldType
    pattern: str | None
    order: DateOrder | None
    languages: list[str]
    region: str | None
    currency: str | None
    decimal: DecimalSign | None
