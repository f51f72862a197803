"""A value that was found in a text."""

from collections.abc import Iterable
from dataclasses import dataclass

from services.contract.fields import ValueProblem


@dataclass(frozen=True, slots=True)
class FoundValue:
    """A normalized value; `span` has the first and the last (exclusive) character of the text that it was read from.

    `value` is None where the text has none of the type, or different ones; `problem` says which.
    `currency` is the code (ISO 4217) of an amount, if that is known.
    """

    value: str | None
    span: tuple[int, int] = (0, 0)
    currency: str | None = None
    problem: ValueProblem | None = None


NO_VALUE = FoundValue(None, problem="no-value")


def the_only(found: Iterable[FoundValue]) -> FoundValue:
    """The value that a text has; without one if it has none, or different ones."""
    each = list(found)
    if not each:
        return NO_VALUE
    if any(other.problem == "ambiguous" for other in each):
        return FoundValue(None, problem="ambiguous")
    if len({(other.value, other.currency) for other in each}) > 1:
        return FoundValue(None, problem="several-values")
    return each[0]
