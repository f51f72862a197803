"""The runner's source of work: here the store itself, polled."""

import asyncio
import logging
import random
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from typing import Protocol

from app.jobs.registry import Jobs
from app.jobs.running import JobRunner
from models.errors import StoreError
from services.heap import release_freed_memory

log = logging.getLogger(__name__)
_random = random.Random()  # its own: the generator of the process belongs to nobody

ASK_EVERY_S = 1.0
"""Pause after which a free slot asks for jobs of other processes; those of its own process are announced."""
OFTEN_S = 5.0
"""Jobs that stalled are settled and old ones purged so often. Freed memory goes back to the system too: uploads pass
through many threads, and the C library keeps what each of them has freed, so that a process that lets uploads of 10 MB
pass would grow with every hundred of them."""
SWEEP_EVERY_S = 600.0


class Dispatch(Protocol):
    """Brings jobs to free slots of a `JobRunner`."""

    async def start(self) -> None: ...
    def enlist(self, job_id: str, connection: object) -> None: ...
    async def announce(self) -> None: ...
    async def settle(self) -> None: ...
    async def live_workers(self) -> int | None: ...
    async def stop(self, grace_s: float) -> None: ...


class LocalDispatch:
    """Runs up to `slots` jobs at once in this process. It needs no queue but the rows of the jobs."""

    def __init__(self, runner: JobRunner, slots: int) -> None:
        self._runner = runner
        self._slots = slots
        self._news = asyncio.Event()  # replaced by a new one with every announcement
        self._stopping = False
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        """Begin to run jobs."""
        self._runner.start()
        self._tasks = [asyncio.create_task(self._fill_slot()) for _ in range(self._slots)]

    def enlist(self, job_id: str, connection: object) -> None:
        """Nothing: the rows of the jobs are the queue."""

    async def announce(self) -> None:
        """Say that there is one more job."""
        news, self._news = self._news, asyncio.Event()
        news.set()

    async def settle(self) -> None:
        """Nothing: slots ask the store themselves."""

    async def live_workers(self) -> int | None:
        """Number of processes that run jobs."""
        return min(1, self._slots)

    async def stop(self, grace_s: float) -> None:
        """Take no more jobs; those that still run after `grace_s` seconds are handed back."""
        self._stopping = True
        await self.announce()
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=grace_s)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._runner.stop()

    async def _fill_slot(self) -> None:
        while not self._stopping:
            news = self._news  # of what is announced from here on
            try:
                if await self._runner.run_one():
                    continue
            except StoreError as error:
                log.warning("no job could be taken: %s", error.detail)
                await asyncio.sleep(ASK_EVERY_S)
            with suppress(TimeoutError):
                async with asyncio.timeout(ASK_EVERY_S * _random.uniform(0.8, 1.2)):
                    await news.wait()


Duty = tuple[float, Callable[[], Awaitable[object]]]
"""What is to be done, and the pause between two times, seconds."""


class Housekeeping:
    """What has to be done at intervals by every process, whether it runs jobs or not."""

    def __init__(self, jobs: Jobs, runner: JobRunner, dispatch: Dispatch, *others: Duty) -> None:
        self._duties: list[Duty] = [
            (OFTEN_S, runner.settle_stalled),
            (OFTEN_S, dispatch.settle),
            (OFTEN_S, jobs.purge),
            (SWEEP_EVERY_S, jobs.sweep_blobs),
            (OFTEN_S, partial(asyncio.to_thread, release_freed_memory)),
            *others,
        ]
        self._tasks: list[asyncio.Task[None]] = []

    def start(self) -> None:
        """Begin."""
        self._tasks = [asyncio.create_task(self._repeat(*duty)) for duty in self._duties]

    async def stop(self) -> None:
        """End."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _repeat(self, every_s: float, duty: Callable[[], Awaitable[object]]) -> None:
        while True:
            try:
                await duty()
            except StoreError as error:
                log.warning("jobs could not be cleaned up: %s", error.detail)
            except Exception:
                log.exception("jobs could not be cleaned up")
            await asyncio.sleep(every_s * _random.uniform(0.8, 1.2))
