"""`If-Match` and `If-None-Match` by RFC 9110."""

import pytest

from app.http.preconditions import PreconditionFailed, entity_tag, parse_precondition
from services.errors import InvalidOption


@pytest.mark.parametrize(
    ("if_match", "if_none_match", "current"),
    [
        (None, None, None),
        (None, None, 3),
        ("*", None, 3),
        (entity_tag(3), None, 3),
        ("3", None, 3),
        ("1, 3", None, 3),
        ('"1", "3"', None, 3),
        ('"1","3"', None, 1),
        (' "3" ', None, 3),
        (None, "*", None),
        (None, " * ", None),
    ],
)
def test_what_is_met(if_match: str | None, if_none_match: str | None, current: int | None) -> None:
    parse_precondition(if_match, if_none_match).check("letter", current)


@pytest.mark.parametrize(
    ("if_match", "if_none_match", "current"),
    [
        ("*", None, None),
        ('"3"', None, None),
        ('"3"', None, 4),
        ('W/"3"', None, 3),
        ('"0x3"', None, 3),
        ("", None, 3),
        ('"99999999999999999999"', None, 3),
        (None, "*", 3),
        ('"3"', "*", 3),
        ('"3"', "*", None),
        ("*", "*", None),
    ],
)
def test_what_is_not_met(if_match: str | None, if_none_match: str | None, current: int | None) -> None:
    with pytest.raises(PreconditionFailed, match="letter") as raised:
        parse_precondition(if_match, if_none_match).check("letter", current)
    assert str(current or "no version") in raised.value.detail


@pytest.mark.parametrize(("if_match", "if_none_match"), [(None, '"3"'), (None, ""), ("*", "3")])
def test_other_uses_of_if_none_match_are_refused(if_match: str | None, if_none_match: str) -> None:
    with pytest.raises(InvalidOption) as raised:
        parse_precondition(if_match, if_none_match)
    assert raised.value.field == "If-None-Match"
