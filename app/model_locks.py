"""One task at a time that learns, for each model, so that no work is done twice.

Tasks of a process wait for each other; processes for a short time only (`interprocess_lock`). What keeps a model
consistent is the version that the store expects of a writer.
"""

import asyncio
from collections.abc import AsyncIterator, Iterable
from contextlib import AsyncExitStack, asynccontextmanager

from app.engine.base import Busy
from app.interprocess_lock import InterprocessLock

PATIENCE_S = 2.0
"""Seconds to wait for other processes, which need some 50 ms each; then a task goes on without their lock."""


class ModelLocks:
    """Locks by name; there are only those that somebody holds or waits for."""

    def __init__(self, between_processes: InterprocessLock) -> None:
        self._between_processes = between_processes
        self._locks: dict[str, asyncio.Lock] = {}
        self._users: dict[str, int] = {}

    @asynccontextmanager
    async def hold(self, names: Iterable[str], timeout_s: float, setting: str) -> AsyncIterator[None]:
        """Hold the locks of all these models for the block; every caller takes them in the same order.

        Raises
        ------
        Busy
            When others hold one of them for longer than `timeout_s` (the `setting`).
        """
        async with AsyncExitStack() as held:
            wanted = sorted(set(names))
            try:
                async with asyncio.timeout(timeout_s):
                    for name in wanted:
                        await held.enter_async_context(self._one(name))
            except TimeoutError:
                raise Busy(
                    f"Others teach {' or '.join(wanted)} for longer than {timeout_s:g} s ({setting}); "
                    "send the request again later."
                ) from None
            for name in wanted:
                await held.enter_async_context(self._between_processes.take(name, PATIENCE_S))
            yield

    def close(self) -> None:
        """Release the locks between processes."""
        self._between_processes.close()

    @asynccontextmanager
    async def _one(self, name: str) -> AsyncIterator[None]:
        lock = self._locks.setdefault(name, asyncio.Lock())
        self._users[name] = self._users.get(name, 0) + 1
        try:
            async with lock:
                yield
        finally:
            self._users[name] -= 1
            if not self._users[name]:
                del self._users[name], self._locks[name]
