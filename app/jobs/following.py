"""Who follows a job hears of its changes, whichever process made them.

A process that shares PostgreSQL is notified of changes (`changes`). The rows are polled as well: often where there are
no notifications, seldom where there are.
"""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import suppress

from app.engine.base import Busy
from app.storage.layout_store import LayoutStore
from models.errors import NoSuchJob, StoreError
from models.job_records import StoredJob

log = logging.getLogger(__name__)

COME_AGAIN_S = 5
"""`Retry-After` of a request that finds no free place."""
POLL_FIRST_S, POLL_EVERY_S, POLL_GROWTH = 0.01, 0.1, 1.5
"""Pauses between polls of the rows of followed jobs: short at first, for short jobs, then longer by this factor."""
POLL_WHEN_NOTIFIED_S = 1.0
"""Pause between polls while changes are notified: a notification that was lost with its connection is made up then."""
_GONE = -1
"""In place of the revision of a job that is deleted."""


class Followers:
    """Listeners to the jobs of all services that share the store."""

    def __init__(self, store: LayoutStore, most: int, heartbeat_s: float) -> None:
        """`most` limits the listeners by `enter`; `heartbeat_s` is the longest silence of `follow`, seconds."""
        self._store = store
        self._most = most
        self._heartbeat_s = heartbeat_s
        self._entered = 0
        self._closed = False
        self._is_notified = False
        self._followed: dict[str, int] = {}
        self._revisions: dict[str, int] = {}
        self._changed = asyncio.Event()  # replaced by a new one with every change
        self._due = asyncio.Event()
        self._poller: asyncio.Task[None] | None = None

    def enter(self) -> None:
        """Count one more listener.

        Raises
        ------
        Busy
            When there are too many listeners.
        """
        if self._entered >= self._most:
            raise Busy(
                f"There are already {self._entered} listeners (MAX_JOB_LISTENERS). Request the job's state instead.",
                COME_AGAIN_S,
            )
        self._entered += 1

    def leave(self) -> None:
        """Count one listener less."""
        self._entered -= 1

    async def follow(self, job: StoredJob) -> AsyncIterator[StoredJob | None]:
        """Yield the job now and after each change, None after a heartbeat without a change.

        Ends when the job has ended or is deleted, or the service stops. Intermediate changes may be missed, the last
        one never.
        """
        self._followed[job.id] = self._followed.get(job.id, 0) + 1
        self._due.set()  # it may have changed since it was read
        try:
            yield job
            while not job.is_over and not self._closed:
                if not await self._has_changed(job):
                    yield None
                    continue
                try:
                    job = await self._store.call(lambda store: store.job(job.id))  # noqa: B023
                except NoSuchJob:
                    return
                yield job
        finally:
            self._followed[job.id] -= 1
            if not self._followed[job.id]:
                del self._followed[job.id]
                self._revisions.pop(job.id, None)

    def hear(self, job_id: str, revision: int) -> None:
        """Take notice that a job has this revision now."""
        if job_id in self._followed:
            self._note(job_id, revision)
            self._wake()

    def expect(self, *, is_notified: bool) -> None:
        """From now on changes are notified, or no longer. What happened before is polled at once."""
        self._is_notified = is_notified
        self._due.set()

    def close(self) -> None:
        """Disconnect the listeners."""
        self._closed = True
        self._due.set()
        self._wake()

    def _note(self, job_id: str, revision: int) -> None:
        """Revisions only grow: a poll that has begun earlier does not take a newer one back."""
        if revision != _GONE:
            revision = max(revision, self._revisions.get(job_id, 0))
        self._revisions[job_id] = revision

    def _wake(self) -> None:
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    async def _has_changed(self, job: StoredJob) -> bool:
        """Wait for a change; False after a heartbeat without one."""
        if self._poller is None or self._poller.done():
            self._poller = asyncio.create_task(self._poll())
        try:
            async with asyncio.timeout(self._heartbeat_s):
                while self._revisions.get(job.id, job.revision) == job.revision and not self._closed:
                    await self._changed.wait()
        except TimeoutError:
            return False
        return True

    async def _poll(self) -> None:
        """Read the revisions of all followed jobs, again and again, while there are any."""
        pause_s = POLL_FIRST_S
        while self._followed and not self._closed:
            self._due.clear()
            ids = list(self._followed)
            try:
                found = await self._store.call(lambda store: store.job_revisions(ids))  # noqa: B023
                for id in self._followed.keys() & set(ids):
                    self._note(id, found.get(id, _GONE))
            except StoreError as error:
                log.warning("jobs cannot be followed: %s", error)
            self._wake()
            with suppress(TimeoutError):
                async with asyncio.timeout(POLL_WHEN_NOTIFIED_S if self._is_notified else pause_s):
                    await self._due.wait()
            pause_s = POLL_FIRST_S if self._due.is_set() else min(POLL_GROWTH * pause_s, POLL_EVERY_S)
