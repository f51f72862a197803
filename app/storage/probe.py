"""Checks of what may hang, for probes that must be answered at once."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Generic, TypeVar

T = TypeVar("T")
PROBE_TIMEOUT_S = 0.7
"""Time for a check of the store by `/health/ready`, which answers within a second."""


class Probe(Generic[T]):
    """A check in a thread of its own. There is one at a time; who asks meanwhile waits for the same one."""

    def __init__(self, check: Callable[[], T], name: str) -> None:
        self._check = check
        self._thread = ThreadPoolExecutor(1, name)
        self._running: asyncio.Future[T] | None = None

    async def result(self, within_s: float) -> T | None:
        """What the check returns; None when it raises `OSError` or takes longer than `within_s` seconds."""
        if self._running is None or self._running.done():
            self._running = asyncio.get_running_loop().run_in_executor(self._thread, self._check)
        running = self._running
        await asyncio.wait((running,), timeout=within_s)
        if not running.done() or isinstance(running.exception(), OSError):
            return None
        return running.result()

    def close(self) -> None:
        """Take no more checks."""
        self._thread.shutdown(wait=False, cancel_futures=True)
