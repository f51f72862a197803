"""One learner at a time for each model, so that they need not do their work twice.

Within a process they wait for each other; processes take turns as a courtesy. What keeps a model whole is the version
that the store expects of a writer.
"""

import asyncio
from collections.abc import AsyncIterator, Iterable
from contextlib import AsyncExitStack, asynccontextmanager

from app.engine.base import Busy
from app.process_turns import ProcessTurns

PATIENCE_S = 2.0
"""For the turn among processes, which take some 50 ms each; then a learner goes on without it."""


class ModelLocks:
    """Locks by name; there are only those that somebody holds or waits for."""

    def __init__(self, turns: ProcessTurns) -> None:
        self._turns = turns
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
            for name in wanted:
                await held.enter_async_context(self._turns.take(name, PATIENCE_S))
            yield

    def close(self) -> None:
        """Leave no turn taken."""
        self._turns.close()

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
