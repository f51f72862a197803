"""Jobs, as the routes see them: accepted, shown, cancelled and deleted. They are rows of the store."""

import hashlib
import logging
import uuid
from collections.abc import Callable, Coroutine, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Any

from fastapi import Request
from starlette.responses import Response

from app.engine.base import Busy
from app.jobs.answers import failed
from app.jobs.following import COME_AGAIN_S, Followers
from app.jobs.stored_request import body_of, describe_request
from app.storage.blobs import BlobAccess
from app.storage.layout_store import LayoutStore
from models.errors import JobKeyReused, NoSuchJob, QueueFull, StoreError
from models.job_records import (
    JOB_BLOBS,
    JobBounds,
    JobDraft,
    RequestJson,
    StoredJob,
    blob_key,
    job_of_blob,
)
from services.errors import DocumentError

log = logging.getLogger(__name__)

KEY_HEADER = "Idempotency-Key"
ORPHANED_AFTER = timedelta(hours=1)
"""Age from which a blob without a job is one that a crash has left."""
_FORM_HEADS_BYTES = 64 * 1024
"""Allowance for the heads of the parts of a form."""


class JobNotFound(DocumentError):
    """There is no such job, it has expired, or it belongs to another API key."""

    code = "not-found"


class JobNotFinished(DocumentError):
    """The job has no answer yet."""

    code = "not-finished"


class JobCancelled(DocumentError):
    """The job was cancelled and will have no answer."""

    code = "cancelled"


@dataclass(frozen=True, slots=True)
class Repeatable:
    """Idempotency-Key of a request, and a digest of all that it asks for."""

    key: str
    digest: str


@dataclass(frozen=True, slots=True)
class JobLimits:
    """Limits on jobs. `app.settings` documents them; their names there contain `max_` or `job_`.

    `heartbeat_s` is the longest pause between two messages to a listener, seconds. Proxies close a connection
    that is silent for a minute.
    """

    ttl_s: float = 3600.0
    max_jobs: int = 1000
    max_jobs_per_key: int = 1000
    max_input_bytes: int = 1 << 32
    max_result_bytes: int = 1 << 29
    max_listeners: int = 100
    heartbeat_s: float = 15.0

    @property
    def bounds(self) -> JobBounds:
        """Bounds of what is unfinished."""
        return JobBounds(self.max_jobs, self.max_jobs_per_key, self.max_input_bytes)


def _ignore(job_id: str, connection: object) -> None:
    """Nothing comes with a job where no process carries it."""


async def _nothing(job_id: str = "") -> None:
    """Nobody in this process runs jobs."""


@dataclass(frozen=True, slots=True)
class JobWork:
    """What a change of the jobs is for those who run them; nothing where this process runs none."""

    enlist: Callable[[str, Any], None] = _ignore
    """Does what has to come with a new job: its id, and the driver's connection of the transaction that stores it."""
    announce: Callable[[], Coroutine[Any, Any, None]] = _nothing
    """Tells whoever runs jobs in this process that there is one more."""
    abandon: Callable[[str], Coroutine[Any, Any, None]] = _nothing
    """Stops a job if this process runs it, and waits for that."""


class Jobs:
    """The jobs of all services that share the store and the blobs."""

    def __init__(
        self, store: LayoutStore, blobs: BlobAccess, limits: JobLimits, work: JobWork | None = None
    ) -> None:
        self._store = store
        self._blobs = blobs
        self._limits = limits
        self.followers = Followers(store, limits.max_listeners, limits.heartbeat_s)
        self._work = work or JobWork()

    # Accepting

    async def require_room(self, owner: str | None, input_bytes: int, key: str | None = None) -> None:
        """Raise `Busy` when a job of this owner would not be accepted now. The body need not be read for that.

        A job with the Idempotency-Key `key` of the owner needs no room: the request may be a repeated one.
        """
        bounds = self._limits.bounds
        try:
            await self._store.call(lambda store: store.require_queue_room(bounds, owner, input_bytes))
        except QueueFull as full:
            if key is not None:
                repeat_key = _repeat_key(key, owner)
                if await self._store.call(lambda store: store.has_job_of_key(repeat_key)):
                    return
            raise _busy(full) from None

    async def repeated(self, request: Repeatable, owner: str | None) -> StoredJob | None:
        """The job that the same request of the same owner started before; None: there is none.

        Raises
        ------
        JobKeyReused
            When the key came with a different request.
        """
        key = _repeat_key(request.key, owner)
        return await self._store.call(lambda store: store.repeated_job(key, request.digest))

    async def accept(
        self,
        request: Request,
        owner: str | None,
        repeatable: Repeatable | None = None,
        callback_url: str | None = None,
    ) -> StoredJob:
        """Store the request as a job, with its body as a blob, and return the job.

        Raises
        ------
        Busy
            When too much is unfinished already.
        JobKeyReused
        """
        parts, most_bytes, content_type = await body_of(request)
        await self.require_room(owner, most_bytes)
        return await self.store_job(
            describe_request(request, content_type),
            parts,
            most_bytes,
            owner,
            str(getattr(request.scope.get("route"), "operation_id", None) or "request"),
            repeatable=repeatable,
            callback_url=callback_url,
        )

    async def store_job(
        self,
        description: RequestJson,
        parts: Iterator[bytes],
        most_bytes: int,
        owner: str | None,
        operation: str,
        *,
        priority: int = 0,
        repeatable: Repeatable | None = None,
        callback_url: str | None = None,
    ) -> StoredJob:
        """Store a request of `describe_request` with the parts of its body as a job, and announce it.

        Raises
        ------
        Busy, JobKeyReused
        StoreUnavailable
            Also where it is not known whether the job was stored.
        """
        job_id = uuid.uuid4().hex  # 122 random bits: cannot be guessed
        key, size = blob_key(job_id, "input"), 0
        if most_bytes:
            size = await self._blobs.put(key, parts, most_bytes + _FORM_HEADS_BYTES)
        draft = JobDraft(
            id=job_id,
            owner=owner,
            operation=operation,
            request=description,
            input_key=key if size else None,
            input_bytes=size,
            repeat_key=None if repeatable is None else _repeat_key(repeatable.key, owner),
            digest=None if repeatable is None else repeatable.digest,
            priority=priority,
            callback_url=callback_url,
        )
        bounds, unneeded = self._limits.bounds, [key] if size else []
        enlist = partial(self._work.enlist, job_id)
        # After any other error the job may be there: the connection may break when the commit is done already. The
        # sweep deletes what nobody needs.
        try:
            job, is_new = await self._store.call(lambda store: store.add_job(draft, bounds, enlist))
        except QueueFull as full:
            await self._forget(unneeded)
            raise _busy(full) from None
        except JobKeyReused:
            await self._forget(unneeded)
            raise
        if is_new:
            await self._work.announce()
        else:
            await self._forget(unneeded)
        return job

    # Showing

    async def find(self, id: str, owner: str | None, *, sees_all: bool = False) -> StoredJob:
        """The job with this id; `sees_all` finds those of other owners too.

        Raises
        ------
        JobNotFound
            When there is no such job, or another owner has it. Both cases look the same to the caller.
        """
        try:
            job = await self._store.call(lambda store: store.job(id))
            if sees_all or job.owner == owner:
                return job
        except NoSuchJob:
            pass
        raise JobNotFound(
            f"There is no job {id[:64]}. Jobs are kept for {self._limits.ttl_s:g} s (JOB_TTL_S) after their end; "
            "too many newer jobs (MAX_JOBS, MAX_JOB_RESULT_BYTES) remove them earlier."
        )

    async def answer(self, job: StoredJob) -> Response:
        """Response that the request would have received without a job.

        Raises
        ------
        JobNotFinished
        """
        if not job.is_over or job.answer is None:
            raise JobNotFinished(f"The job is {job.state}; it has no result yet.")
        status = job.answer["status"]
        headers = [(name.encode("latin-1"), value.encode("latin-1")) for name, value in job.answer["headers"]]
        if job.problem is not None:
            response = Response(job.answer["body"].encode(), status)
        elif job.answer_key is None:
            response = Response(b"", status)
        else:
            response = Response(await self._blobs.get(job.answer_key), status)
        response.raw_headers = headers
        return response

    async def cancel(self, job: StoredJob, problem: Response) -> None:
        """End the job now, if it has not ended; whoever runs it notices that the lease is lost, and stops."""
        end = failed(problem, "cancelled")
        ttl_s = self._limits.ttl_s
        if await self._store.call(lambda store: store.end_job(job.id, None, end, ttl_s)):
            log.info("job ended", extra={"job": job.id, "state": "cancelled"})
            await self._forget([job.input_key] if job.input_key else [])
            await self._work.abandon(job.id)

    async def delete(self, job: StoredJob) -> None:
        """Delete a finished job with its result."""
        await self._forget(await self._store.call(lambda store: store.delete_job(job.id)))

    # Keeping house

    async def purge(self) -> None:
        """Delete what has expired, and what is over a limit."""
        limits = self._limits
        await self._forget(
            await self._store.call(lambda store: store.purge_jobs(limits.max_jobs, limits.max_result_bytes))
        )

    async def sweep_blobs(self) -> int:
        """Delete the blobs that a crash has left without a job; their number."""
        old: list[str] = []

        def note(key: str) -> bool:
            old.append(key)
            return True  # nothing is deleted yet

        before = datetime.now(UTC) - ORPHANED_AFTER
        await self._blobs.sweep(JOB_BLOBS, before, note)
        ids = {job_of_blob(key) for key in old}
        known = {id: await self._store.call(lambda store: store.has_job(id)) for id in ids}  # noqa: B023
        orphans = [key for key in old if not known[job_of_blob(key)]]
        await self._forget(orphans)
        return len(orphans)

    async def _forget(self, keys: list[str]) -> None:
        """Delete blobs. A failure is logged only: the sweep deletes them later."""
        try:
            if keys:
                await self._blobs.delete(*keys)
        except StoreError as error:
            log.warning("blobs could not be deleted: %s", error)


def _repeat_key(key: str, owner: str | None) -> str:
    return hashlib.sha256(f"{owner or ''}\n{key}".encode("utf-8", "surrogatepass")).hexdigest()


def _busy(full: QueueFull) -> Busy:
    return Busy(f"The queue is full: {full.detail}. Send the request again later.", COME_AGAIN_S)
