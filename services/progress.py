"""Progress reports of long work.

Work reports its progress without knowing whether a sink receives it. The sink belongs to the context that set it, so
threads that the work starts report nothing.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

ProgressSink = Callable[[str, float], None]
"""Takes the name of a stage, and the finished share 0-1 of the whole work."""

_SINK: ContextVar[ProgressSink | None] = ContextVar("progress_sink", default=None)


def report_progress(stage: str, fraction: float) -> None:
    """Report that `stage` has begun or continues, with `fraction` (0-1, clipped) of the work done."""
    sink = _SINK.get()
    if sink is not None:
        sink(stage, min(1.0, max(0.0, fraction)))


@contextmanager
def progress_to(sink: ProgressSink | None) -> Iterator[None]:
    """Send reports of the block to `sink`; None: discard them."""
    token = _SINK.set(sink)
    try:
        yield
    finally:
        _SINK.reset(token)


@contextmanager
def progress_within(begin: float, end: float) -> Iterator[None]:
    """Map the block's fractions from 0 to 1 to `begin` to `end` of the enclosing work."""
    outer = _SINK.get()
    if outer is None:
        yield
        return

    def scaled(stage: str, fraction: float) -> None:
        outer(stage, begin + (end - begin) * fraction)

    with progress_to(scaled):
        yield
