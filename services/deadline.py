"""When the work of a call must be answered: work that may stop earlier asks how much time is left.

Like progress, the deadline belongs to the context that set it; without one there is no end.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_END_S: ContextVar[float] = ContextVar("deadline", default=float("inf"))
"""By `time.monotonic`."""


def time_left_s() -> float:
    """Seconds of wall time until the deadline, 0 after it; infinite without one."""
    return max(0.0, _END_S.get() - time.monotonic())


@contextmanager
def answered_within(seconds: float) -> Iterator[None]:
    """The block's deadline is in so many seconds, or that of the enclosing work if it is sooner."""
    token = _END_S.set(min(_END_S.get(), time.monotonic() + seconds))
    try:
        yield
    finally:
        _END_S.reset(token)
