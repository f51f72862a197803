"""How far long work has come, for whoever waits for it.

Work says where it stands; whether anybody listens is not its business. A sink belongs to the context that set it, so
that threads which work starts of their own stay silent instead of speaking all at once.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

ProgressSink = Callable[[str, float], None]
"""Takes the name of a stage, and the share 0-1 of the whole work that is done."""

_SINK: ContextVar[ProgressSink | None] = ContextVar("progress_sink", default=None)


def report_progress(stage: str, fraction: float) -> None:
    """Tell that `stage` has begun or goes on, with `fraction` (0-1, clipped) of the work done."""
    sink = _SINK.get()
    if sink is not None:
        sink(stage, min(1.0, max(0.0, fraction)))


@contextmanager
def progress_to(sink: ProgressSink | None) -> Iterator[None]:
    """Hand what the block reports to `sink`; None: to nobody."""
    token = _SINK.set(sink)
    try:
        yield
    finally:
        _SINK.reset(token)


@contextmanager
def progress_within(begin: float, end: float) -> Iterator[None]:
    """Make what the block reports from 0 to 1 the part from `begin` to `end` of the work around it."""
    outer = _SINK.get()
    if outer is None:
        yield
        return

    def scaled(stage: str, fraction: float) -> None:
        outer(stage, begin + (end - begin) * fraction)

    with progress_to(scaled):
        yield
