"""How much processor time each step of an event loop takes: between two steps nobody else is answered."""

import asyncio
import gc
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

MOST_STEP_S = 0.05
"""Processor time of one step of the service's loop, on a processor that does `_work` in `_WORK_S`."""
_WORK_S = 0.010


def most_step_s() -> float:
    """`MOST_STEP_S` by the pace of this processor now: others that share it take from its caches and its clock."""
    begin_s = time.thread_time()
    _work()
    return MOST_STEP_S * max(1.0, (time.thread_time() - begin_s) / _WORK_S)


def _work() -> list[dict[str, str]]:
    """What steps do most: make and free small objects."""
    return [{"text": str(number)} for number in range(40_000)]


@dataclass(slots=True)
class LoopWatch:
    """The longest step of the watched loop since the last reset."""

    seconds: float = 0.0
    thread: int | None = None
    collected_s: float = field(default=0.0, repr=False)


@contextmanager
def watched() -> Iterator[LoopWatch]:
    """Watch the loop whose thread is set as `thread`; collections of garbage, which are long in a large process of
    tests, do not count.
    """
    watch, run = LoopWatch(), asyncio.Handle._run
    began_s = 0.0

    def collect(phase: str, info: dict[str, int]) -> None:
        nonlocal began_s
        if threading.get_ident() != watch.thread:
            return
        if phase == "start":
            began_s = time.thread_time()
        else:
            watch.collected_s += time.thread_time() - began_s

    def run_and_note(handle: asyncio.Handle) -> None:
        if threading.get_ident() != watch.thread:
            run(handle)
            return
        begin_s, watch.collected_s = time.thread_time(), 0.0
        run(handle)
        watch.seconds = max(watch.seconds, time.thread_time() - begin_s - watch.collected_s)

    asyncio.Handle._run = run_and_note  # type: ignore[method-assign]
    gc.callbacks.append(collect)
    try:
        yield watch
    finally:
        gc.callbacks.remove(collect)
        asyncio.Handle._run = run  # type: ignore[method-assign]
