"""One learner at a time for each model of this process, so that they need not do their work twice.

Processes do not see each other's locks: what keeps a model whole is the version that the store expects of a writer.
"""

import asyncio
from collections.abc import AsyncIterator, Iterable
from contextlib import AsyncExitStack, asynccontextmanager

from app.engine.base import Busy


class ModelLocks:
    """Locks by name; there are only those that somebody holds or waits for."""

    def __init__(self) -> None:
        self._locks: dict[str, asyncio.Lock] = {}
        self._users: dict[str, int] = {}

    @asynccontextmanager
    async def hold(self, names: Iterable[str], timeout_s: float, setting: str) -> AsyncIterator[None]:
        """All of these models for the block, taken in one order by everybody.

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
            yield

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
