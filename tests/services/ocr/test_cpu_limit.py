"""A call ends when its processor time is over, and nothing is left of the limit."""

import signal

import pytest

from services.deadline import answered_within
from services.ocr.cpu_limit import CpuTimeOver, cpu_limit


def _work_within(seconds: float) -> None:
    with cpu_limit(seconds):
        while True:
            pass


def test_a_busy_call_is_ended_and_the_next_one_is_not() -> None:
    before = signal.getsignal(signal.SIGPROF)
    with pytest.raises(CpuTimeOver):
        _work_within(0.001)
    assert signal.getsignal(signal.SIGPROF) is before
    assert signal.getitimer(signal.ITIMER_PROF) == (0.0, 0.0)
    with cpu_limit(600.0):
        pass
    assert signal.getitimer(signal.ITIMER_PROF) == (0.0, 0.0)


def test_a_call_is_ended_at_the_deadline_of_its_work() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with pytest.raises(CpuTimeOver), answered_within(0.001):
        _work_within(600.0)
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
