"""The time that is left to work, and to the work within it."""

import pytest

from services.deadline import answered_within, time_left_s


def test_without_a_deadline_there_is_no_end() -> None:
    assert time_left_s() == float("inf")
    with answered_within(float("inf")):
        assert time_left_s() == float("inf")


def test_work_within_work_ends_no_later() -> None:
    with answered_within(100.0):
        assert 0.0 < time_left_s() <= 100.0
        with answered_within(200.0):
            assert time_left_s() <= 100.0
        with answered_within(10.0):
            assert time_left_s() <= 10.0
        with answered_within(0.0):
            assert time_left_s() == pytest.approx(0.0)
        assert time_left_s() > 10.0
    assert time_left_s() == float("inf")
