"""Jobs: long work that is accepted at once. The response is kept for a limited time.

Everything is in this process: a restart loses the jobs and their responses.
"""

import asyncio
import json
import logging
import time
import uuid
from collections import deque
from collections.abc import AsyncIterator, Callable, Coroutine
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal

from starlette.responses import Response

from app.engine.base import Busy, ShuttingDown
from app.kept_answer import KeptAnswer
from services.errors import DocumentError, TooLarge
from services.progress import ProgressSink

log = logging.getLogger(__name__)

JobState = Literal["queued", "running", "succeeded", "failed", "cancelled"]
Work = Callable[[ProgressSink | None], Coroutine[Any, Any, Response]]
"""Coroutine that answers a request. It passes the sink to `Engine.submit`; None: progress is not reported."""
Tell = Callable[[Exception], Response]
"""Returns the problem document with which the request would have been answered."""
MOST_KEY_CHARACTERS = 200
"""Longest Idempotency-Key."""
COME_AGAIN_S = 5
"""`Retry-After` of a request that finds no free place."""


class JobNotFound(DocumentError):
    """There is no such job, it has expired, or it belongs to another API key."""

    code = "not-found"


class JobNotFinished(DocumentError):
    """The job has no answer yet."""

    code = "not-finished"


class JobCancelled(DocumentError):
    """The job was cancelled and will have no answer."""

    code = "cancelled"


class KeyReused(DocumentError):
    """An Idempotency-Key came with a different request before."""

    code = "conflict"


@dataclass(frozen=True, slots=True)
class Repeatable:
    """Idempotency-Key of a request, and a digest of all that it asks for."""

    key: str
    digest: str


@dataclass(frozen=True, slots=True)
class JobLimits:
    """Limits on jobs. `app.settings` documents the first four; their names there contain `max_` or `job_`.

    `heartbeat_s` is the longest pause between two messages to a listener, seconds. Proxies close a connection
    that is silent for a minute.
    """

    ttl_s: float = 3600.0
    max_jobs: int = 200
    max_result_bytes: int = 1 << 29
    max_listeners: int = 100
    heartbeat_s: float = 15.0


class Job:
    """State of one job."""

    def __init__(self, owner: str | None, repeatable: Repeatable | None = None) -> None:
        """`owner` is the name of the request's API key; None if the service has no keys."""
        self.id = uuid.uuid4().hex  # 122 random bits: cannot be guessed
        self.owner = owner
        self.repeatable = repeatable
        self.state: JobState = "queued"
        self.stage: str | None = None
        self.progress = 0.0
        self.created = datetime.now(UTC)
        self.started: datetime | None = None
        self.ended: datetime | None = None
        self.problem: dict[str, Any] | None = None
        self.revision = 0
        """Number of changes."""
        self.answer: KeptAnswer | None = None
        self.expires_s = 0.0
        self.task: asyncio.Task[None] | None = None
        self.is_unwanted = False
        self.changed = asyncio.Event()

    @property
    def is_over(self) -> bool:
        """Whether its state is final."""
        return self.ended is not None

    async def wait(self) -> None:
        """Return when the work has ended for any reason."""
        if self.task is not None:
            await asyncio.wait((self.task,))

    def abandon(self) -> None:
        """Stop the work if it has not ended."""
        if self.task is not None:
            self.task.cancel()

    def report(self, stage: str, fraction: float) -> None:
        """Record progress. The first report means that a worker has started. The fraction never decreases."""
        if self.is_over:
            return
        if self.state == "queued":
            self.state, self.started = "running", datetime.now(UTC)
        self.stage, self.progress = stage, max(self.progress, fraction)
        self.note_change()

    def end(self, state: JobState, problem: dict[str, Any] | None = None) -> None:
        """Record the final state."""
        self.state, self.problem, self.ended = state, problem, datetime.now(UTC)
        if state == "succeeded":
            self.progress = 1.0
        self.note_change()

    def note_change(self) -> None:
        """Notify all listeners."""
        self.revision += 1
        self.changed.set()
        self.changed = asyncio.Event()


class Jobs:
    """The jobs of one app, limited in number, in the bytes of their responses, and in time.

    Over a limit, finished jobs are removed in the order in which they ended. Unfinished jobs hold seats in the engine,
    which also limits their number.
    """

    def __init__(self, limits: JobLimits, clock: Callable[[], float] = time.monotonic) -> None:
        self._limits = limits
        self._clock = clock
        self._jobs: dict[str, Job] = {}
        self._over: deque[Job] = deque()  # in the order in which they ended
        self._bytes = 0
        self._listeners = 0
        self._closed = False
        self._timer: asyncio.TimerHandle | None = None

    def repeated(self, request: Repeatable, owner: str | None) -> Job | None:
        """The job that the same request of the same owner started before; None: there is none.

        Raises
        ------
        KeyReused
            When the key came with a different request.
        """
        self._sweep()
        job = next(
            (
                job
                for job in self._jobs.values()
                if job.owner == owner and job.repeatable is not None and job.repeatable.key == request.key
            ),
            None,
        )
        if job is not None and job.repeatable != request:
            raise KeyReused(
                "This Idempotency-Key came with a different request. Send a new key for new work."
            )
        return job

    def start(self, work: Work, owner: str | None, tell: Tell, repeatable: Repeatable | None = None) -> Job:
        """Start a job and return it; `tell` turns a failure into a response.

        Raises
        ------
        Busy
            When the number of unfinished jobs is at its limit.
        """
        self._sweep()
        while len(self._jobs) >= self._limits.max_jobs and self._over:
            self._drop_oldest()
        if len(self._jobs) >= self._limits.max_jobs:
            raise Busy(
                f"All {self._limits.max_jobs} jobs (MAX_JOBS) are unfinished; send the request again later.",
                COME_AGAIN_S,
            )
        job = Job(owner, repeatable)
        self._jobs[job.id] = job
        job.task = asyncio.create_task(self._run(job, work, tell))
        return job

    def find(self, id: str, owner: str | None, *, sees_all: bool = False) -> Job:
        """The job with this id; `sees_all` finds those of other owners too.

        Raises
        ------
        JobNotFound
            When there is no such job, or another owner has it. Both cases look the same to the caller.
        """
        self._sweep()
        job = self._jobs.get(id)
        if job is None or not (sees_all or job.owner == owner):
            raise JobNotFound(
                f"There is no job {id[:64]}. Jobs are kept for {self._limits.ttl_s:g} s (JOB_TTL_S) after their end; "
                "a restart of the service, or too many newer jobs, removes them earlier."
            )
        return job

    async def answer(self, job: Job) -> Response:
        """Response that the request would have received without a job.

        Raises
        ------
        JobNotFinished
        """
        if job.answer is None:
            raise JobNotFinished(f"The job is {job.state}; it has no result yet.")
        return await job.answer.response()

    async def cancel(self, job: Job) -> None:
        """Stop the work if it has not ended; return when it has stopped."""
        if not job.is_over:
            job.is_unwanted = True
            job.abandon()
            await job.wait()

    def delete(self, job: Job) -> None:
        """Delete a finished job with its result. A job that is removed already does not change."""
        if job in self._over:
            self._over.remove(job)
            self._drop(job)

    def enter_listener(self) -> None:
        """Count one more listener.

        Raises
        ------
        Busy
            When there are too many listeners.
        """
        if self._listeners >= self._limits.max_listeners:
            raise Busy(
                f"There are already {self._listeners} listeners (MAX_JOB_LISTENERS). Request the job's state instead.",
                COME_AGAIN_S,
            )
        self._listeners += 1

    def leave_listener(self) -> None:
        """Count one listener less."""
        self._listeners -= 1

    async def follow(self, job: Job) -> AsyncIterator[bool]:
        """Yield True now and after each change of the job, False after a heartbeat without a change.

        Ends when the job ends or the service stops. A slow listener may miss intermediate changes, never the last one.
        """
        while True:
            changed = job.changed
            yield True
            if job.is_over or self._closed:
                return
            while True:
                try:
                    async with asyncio.timeout(self._limits.heartbeat_s):
                        await changed.wait()
                    break
                except TimeoutError:
                    yield False

    async def close(self) -> None:
        """Stop the running work, disconnect the listeners, delete everything."""
        self._closed = True
        unfinished = [job for job in self._jobs.values() if not job.is_over]
        for job in unfinished:
            job.abandon()
        for job in unfinished:
            await job.wait()
        while self._over:
            self._drop_oldest()
        if self._timer is not None:
            self._timer.cancel()

    # Internal

    async def _run(self, job: Job, work: Work, tell: Tell) -> None:
        try:
            answer = await work(job.report)
            size = len(answer.body)
            if size > self._limits.max_result_bytes:
                raise TooLarge(
                    f"The result has {size} bytes; the results of all jobs may have {self._limits.max_result_bytes} "
                    "bytes together (MAX_JOB_RESULT_BYTES). Send the request without `Prefer: respond-async`."
                )
            job.answer = await KeptAnswer.of(answer)
            job.end("succeeded")
        except asyncio.CancelledError:
            if job.is_unwanted:
                self._fail(job, "cancelled", tell(JobCancelled("The job was cancelled.")))
            else:
                stopping = ShuttingDown(
                    "The service stopped before the work was done. Send the request again.", 1
                )
                self._fail(job, "failed", tell(stopping))
        except Exception as error:
            self._fail(job, "failed", tell(error))
        self._bytes += job.answer.size if job.answer is not None else 0
        job.expires_s = self._clock() + self._limits.ttl_s
        self._over.append(job)
        log.info("job ended", extra={"job": job.id, "state": job.state})
        self._sweep()

    def _fail(self, job: Job, state: JobState, problem: Response) -> None:
        job.answer = KeptAnswer(problem)
        job.end(state, json.loads(bytes(problem.body)))

    def _sweep(self) -> None:
        """Remove expired jobs and those over the size limit; call this again when the next job expires."""
        now = self._clock()
        while self._over and (self._over[0].expires_s <= now or self._bytes > self._limits.max_result_bytes):
            self._drop_oldest()
        if self._timer is None and self._over and not self._closed:
            wait_s = max(0.0, self._over[0].expires_s - now)
            self._timer = asyncio.get_running_loop().call_later(wait_s, self._sweep_again)

    def _sweep_again(self) -> None:
        self._timer = None
        self._sweep()

    def _drop_oldest(self) -> None:
        self._drop(self._over.popleft())

    def _drop(self, job: Job) -> None:
        del self._jobs[job.id]
        if job.answer is not None:
            self._bytes -= job.answer.size
            job.answer.close()
