"""Running jobs: a lease is taken and renewed, the stored request is done, its answer is written once."""

import asyncio
import json
import logging
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field

from starlette.datastructures import Headers
from starlette.responses import Response

from app.engine.base import WorkerDied
from app.jobs.answers import failed, head_of
from app.jobs.stored_request import JobRun
from app.logs import trace_of
from app.storage.blobs import BlobAccess
from app.storage.layout_store import LayoutStore
from models.blobs import BlobNotFound
from models.errors import StoreError, StoreUnavailable
from models.job_records import JobEnd, Lease, Progress, RequestJson, StoredJob, blob_key
from services.errors import TooLarge

log = logging.getLogger(__name__)

Do = Callable[[RequestJson, AsyncIterator[bytes], JobRun], Awaitable[Response]]
"""Does a stored request: its description, the parts of its body, and what its route needs to know of the job."""
Tell = Callable[[Exception, str], Response]
"""The problem document of an error, for the request with this id."""

HANDED_BACK = frozenset({"busy", "shutting-down", "store-unavailable", "not-ready"})
"""Problems of the service, not of the job: the job is done later."""
TRIED_AGAIN = WorkerDied.code
"""The problem after which a job is tried again, and fails when that was the last attempt."""
_LOST_INPUT = "the worker does not find the upload of this job; send the request again"


@dataclass(frozen=True, slots=True)
class RunLimits:
    """Limits of running jobs.

    `lease_s`: a job whose worker is killed starts again after it; a worker that cannot reach the
    database for so long may lose its job to another one. `most_attempts`: one crash may be an accident.
    `hand_back_s`: pause before a job that the service could not run starts again. `write_for_s`: an answer is offered
    to a database that is away for so long. `renew_every_s`: progress that is not new is written so often; a job that
    was cancelled elsewhere stops within that time. `report_every_s`: new progress is written so often, each
    time with a commit.
    """

    ttl_s: float
    max_result_bytes: int
    lease_s: float = 15.0
    most_attempts: int = 2
    hand_back_s: float = 2.0
    write_for_s: float = 120.0
    renew_every_s: float = 2.0
    report_every_s: float = 0.25


@dataclass(slots=True, eq=False)
class _Running:
    """A job that this process runs."""

    lease: Lease
    task: "asyncio.Task[None]"
    stage: str | None = None
    progress: float = 0.0
    is_new: bool = False
    written_s: float = field(default_factory=time.monotonic)
    is_lost: bool = False
    is_ending: bool = False
    input_is_lost: bool = False

    def report(self, stage: str, fraction: float) -> None:
        """Note progress. The fraction never decreases."""
        self.stage, self.progress = stage, max(self.progress, fraction)
        self.is_new = True


class JobRunner:
    """Runs jobs of the store in this process."""

    def __init__(self, store: LayoutStore, blobs: BlobAccess, do: Do, tell: Tell, limits: RunLimits) -> None:
        self._store = store
        self._blobs = blobs
        self._do = do
        self._tell = tell
        self._limits = limits
        self._running: dict[str, _Running] = {}
        self._renewing: asyncio.Task[None] | None = None
        self.starts = 0
        """Number of attempts that this process has begun."""
        self.leases_lost = 0
        """Number of jobs that ended or went on elsewhere while this process ran them."""

    def start(self) -> None:
        """Begin to renew leases."""
        self._renewing = asyncio.create_task(self._renew())

    async def run_one(self) -> bool:
        """Take the job that is next and run it to its end; False: there was none.

        Raises
        ------
        StoreError
            When no job could be taken.
        """
        lease = await self._store.call(lambda store: store.claim_job(self._limits.lease_s))
        if lease is None:
            return False
        self.starts += 1
        running = _Running(lease, asyncio.create_task(self._run(lease)))
        self._running[lease.job.id] = running
        try:
            await asyncio.wait((running.task,))
        finally:
            if not running.task.done():  # the service stops: the job is handed back
                running.task.cancel()
                await asyncio.shield(asyncio.wait((running.task,)))
            del self._running[lease.job.id]
        return True

    async def abandon(self, job_id: str) -> None:
        """Stop a job if this process runs it; return when it has stopped."""
        running = self._running.get(job_id)
        if running is not None:
            running.is_lost = True
            running.task.cancel()
            await asyncio.wait((running.task,))

    async def stop(self) -> None:
        """Renew no more leases. Callers of `run_one` have ended before."""
        if self._renewing is not None:
            self._renewing.cancel()
            with suppress(asyncio.CancelledError):
                await self._renewing

    async def settle_stalled(self) -> None:
        """Queue jobs again whose workers are gone; end those that have no attempt left."""
        limits, most = self._limits, self._limits.most_attempts
        died = WorkerDied(
            f"The worker ended before the work was done, {most} times. Send another file, or report this one."
        )

        def failure(job: StoredJob) -> JobEnd:
            return failed(self._tell(died, str(job.request["request_id"])))

        again, ended = await self._store.call(
            lambda store: store.settle_stalled_jobs(most, failure, limits.ttl_s, limits.lease_s)
        )
        if again or ended:
            log.warning("jobs had lost their workers", extra={"queued_again": again, "failed": ended})

    # Internal

    async def _run(self, lease: Lease) -> None:
        await asyncio.sleep(0)  # the caller has to note the task first
        running = self._running[lease.job.id]
        facts = {"job": lease.job.id, "attempt": lease.job.attempts, **_trace(lease.job.request)}
        log.info("job started", extra=facts)
        try:
            answer = await self._answer(lease, running)
            state = await self._finish(lease, answer)
        except asyncio.CancelledError:
            state = "lost" if running.is_lost else "handed back"
            if not running.is_lost:
                await self._hand_back(lease, 0.0, is_attempt=False)
        except StoreError as error:
            log.error("a job could not be written: %s", error.detail, extra=facts)
            state = "unwritten"  # its lease ends, and it is tried again
        log.info("job ended", extra={**facts, "state": state})

    async def _answer(self, lease: Lease, running: _Running) -> Response:
        job = lease.job
        parts = _nothing() if job.input_key is None else self._blobs.read(job.input_key)
        request_id = str(job.request["request_id"])
        try:
            answer = await self._do(job.request, _told_loss(parts, running), JobRun(running.report))
            size = len(answer.body)
            if size > self._limits.max_result_bytes:
                raise TooLarge(
                    f"The result has {size} bytes; the results of all jobs may have {self._limits.max_result_bytes} "
                    "bytes together (MAX_JOB_RESULT_BYTES). Send the request without `Prefer: respond-async`."
                )
        except Exception as error:
            return self._tell(error, request_id)
        return answer

    async def _finish(self, lease: Lease, answer: Response) -> str:
        """Write the answer, or hand the job back; what became of the job."""
        job, code = lease.job, _problem_code(answer)
        if code in HANDED_BACK and not self._running[job.id].input_is_lost:
            if await self._hand_back(lease, self._limits.hand_back_s, is_attempt=False):
                return "handed back"
        elif code == TRIED_AGAIN and job.attempts < self._limits.most_attempts:
            await self._hand_back(lease, 0.0, is_attempt=True)
            return "handed back"
        deadline = time.monotonic() + self._limits.write_for_s
        while True:
            try:
                return await self._write(lease, answer, code)
            except StoreUnavailable:
                if time.monotonic() > deadline:
                    raise
            await asyncio.sleep(1.0)

    async def _write(self, lease: Lease, answer: Response, code: str | None) -> str:
        job, ttl_s, key = lease.job, self._limits.ttl_s, None
        if code is not None:
            end = failed(answer)
        else:
            if answer.body:
                # Each lease has a key of its own, so that a late writer cannot replace the answer.
                key = blob_key(job.id, f"answer-{lease.token}")
                await self._blobs.put(key, bytes(answer.body), len(answer.body))
            end = JobEnd("succeeded", head_of(answer), key, len(answer.body))
        # From here on the lease says nothing: who ends a job takes its token away.
        self._running[job.id].is_ending = True
        is_first = await self._store.call(lambda store: store.end_job(job.id, lease.token, end, ttl_s))
        with suppress(StoreError):  # the sweep deletes what remains
            unneeded = job.input_key if is_first else key
            if unneeded is not None:
                await self._blobs.delete(unneeded)
        if not is_first:
            self.leases_lost += 1
            return "lost"
        return end.state

    async def _hand_back(self, lease: Lease, wait_s: float, *, is_attempt: bool) -> bool:
        return await self._store.call(
            lambda store: store.return_job(lease.job.id, lease.token, wait_s, is_attempt=is_attempt)
        )

    async def _renew(self) -> None:
        """Write progress and renew leases, as long as this process runs jobs."""
        renew_every_s = min(self._limits.renew_every_s, self._limits.lease_s / 4)
        while True:
            await asyncio.sleep(self._limits.report_every_s)
            now_s = time.monotonic()
            due = [
                each
                for each in self._running.values()
                if not each.is_ending and (each.is_new or now_s - each.written_s > renew_every_s)
            ]
            if due:
                try:
                    await self._write_progress(due, now_s)
                except StoreError as error:
                    log.warning("leases could not be renewed: %s", error.detail)
                    await asyncio.sleep(1.0)

    async def _write_progress(self, due: list[_Running], now_s: float) -> None:
        reports = [Progress(each.lease.job.id, each.lease.token, each.stage, each.progress) for each in due]
        for each in due:
            each.is_new, each.written_s = False, now_s
        lost = await self._store.call(lambda store: store.renew_leases(reports, self._limits.lease_s))
        for each in due:
            if each.lease.job.id in lost and not (each.task.done() or each.is_lost or each.is_ending):
                self.leases_lost += 1
                each.is_lost = True
                each.task.cancel()


async def _nothing() -> AsyncIterator[bytes]:
    return
    yield b""


async def _told_loss(parts: AsyncIterator[bytes], running: _Running) -> AsyncIterator[bytes]:
    """The parts; if the blob is gone, `running` notes it, and the job is answered `StoreUnavailable`."""
    try:
        async for part in parts:
            yield part
    except BlobNotFound:
        running.input_is_lost = True
        raise StoreUnavailable(_LOST_INPUT) from None


def _problem_code(answer: Response) -> str | None:
    """Code of a problem document; None: the answer is not a problem."""
    if answer.headers.get("content-type") != "application/problem+json":
        return None
    return str(json.loads(bytes(answer.body)).get("code"))


def _trace(request: RequestJson) -> dict[str, str]:
    """What connects log lines of a job with those of its request."""
    return {"request_id": request["request_id"], **trace_of(Headers(request["headers"]))}
