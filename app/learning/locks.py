"""Locks of models: one learning task at a time for each model, so that no work is done twice.

Tasks of one process wait for each other. Processes wait for each other only a short time (`interprocess_lock`).
Consistency does not depend on these locks: the store checks the version that a writer expects.
"""

import asyncio
from collections.abc import AsyncIterator, Iterable
from contextlib import AsyncExitStack, asynccontextmanager

from app.engine.base import Busy
from app.interprocess_lock import InterprocessLock

PATIENCE_S = 2.0
"""Longest wait for other processes, seconds; each needs about 50 ms. Then the task continues without their lock."""


class ModelLocks:
    """Locks by name. A lock exists only while a task holds it or waits for it."""

    def __init__(self, between_processes: InterprocessLock) -> None:
        self._between_processes = between_processes
        self._locks: dict[str, asyncio.Lock] = {}
        self._users: dict[str, int] = {}

    @asynccontextmanager
    async def hold(self, names: Iterable[str], timeout_s: float, setting: str) -> AsyncIterator[None]:
        """Hold the locks of all these models during the block. All callers take them in the same order.

        Raises
        ------
        Busy
            When another task holds one of them for longer than `timeout_s`; `setting` is the name of that limit.
        """
        async with AsyncExitStack() as held:
            wanted = sorted(set(names))
            try:
                async with asyncio.timeout(timeout_s):
                    for name in wanted:
                        await held.enter_async_context(self._one(name))
            except TimeoutError:
                raise Busy(
                    f"Other requests have updated {' or '.join(wanted)} for longer than {timeout_s:g} s ({setting}). "
                    "Send the request again later."
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
