"""Numbers of JSON that can be computed with."""

import math

import pytest

from services.layout.page import InvalidLayout, is_finite_number


@pytest.mark.parametrize("value", [0, -3, 1.5, 1e300, 10**300, -0.0])
def test_finite_numbers(value: float) -> None:
    assert is_finite_number(value)


@pytest.mark.parametrize(
    "value", [math.nan, math.inf, -math.inf, True, False, 10**400, "1", None, [1], {}, 1j]
)
def test_what_is_no_finite_number(value: object) -> None:
    assert not is_finite_number(value)


def test_what_is_invalid_names_its_field() -> None:
    error = InvalidLayout("The box is empty.", "zones[3].box")
    assert isinstance(error, ValueError)
    assert (error.detail, error.field) == ("The box is empty.", "zones[3].box")
    assert InvalidLayout("No page.").field is None
