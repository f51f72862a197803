"""A limit of processor time for one call of a library that looks for signals while it works."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class CpuTimeOver(Exception):
    """The processor time of a call is over."""


def can_limit() -> bool:
    """Whether the calling thread can be interrupted: signals reach the main thread only."""
    return threading.current_thread() is threading.main_thread()


@contextmanager
def cpu_limit(seconds: float) -> Iterator[None]:
    """Raise `CpuTimeOver` in the block once the process has used `seconds` more of processor time.

    Wall time would cut what is read on a busy machine, where a page takes four times as long.
    """
    before = signal.signal(signal.SIGPROF, _end)
    try:
        signal.setitimer(signal.ITIMER_PROF, seconds)
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def _end(number: int, frame: FrameType | None) -> None:
    raise CpuTimeOver
