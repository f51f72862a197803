"""A limit of time for one call of a library that looks for signals while it works."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from services.deadline import time_left_s

_LEAST_S = 0.001
"""A timer of 0 would never end."""


class CpuTimeOver(Exception):
    """The time of a call is over."""


def can_limit() -> bool:
    """Whether the calling thread can be interrupted: signals reach the main thread only."""
    return threading.current_thread() is threading.main_thread()


@contextmanager
def cpu_limit(seconds: float) -> Iterator[None]:
    """Raise `CpuTimeOver` in the block once the process has used `seconds` more of processor time.

    Wall time would cut what is read on a busy machine, where a page takes four times as long; it counts only where the
    work has a deadline.
    """
    limits = [(signal.SIGPROF, signal.ITIMER_PROF, seconds)]
    if (left_s := time_left_s()) < float("inf"):
        limits.append((signal.SIGALRM, signal.ITIMER_REAL, left_s))
    before = [signal.signal(number, _end) for number, _, _ in limits]
    try:
        for _, timer, limit_s in limits:
            signal.setitimer(timer, max(_LEAST_S, limit_s))
        yield
    finally:
        for (number, timer, _), handler in zip(limits, before, strict=True):
            signal.setitimer(timer, 0.0)
            signal.signal(number, handler)


def _end(number: int, frame: FrameType | None) -> None:
    raise CpuTimeOver
