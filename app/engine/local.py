"""The default engine: a pool of processes on this machine.

Workers share nothing, so a failure of one affects only that worker and its one job.
"""

import asyncio
import atexit
import logging
import math
import multiprocessing
import os
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar, cast

from app.engine import worker as inside
from app.engine.base import (
    STARTED,
    Busy,
    EngineFailed,
    EngineStatus,
    JobFailed,
    JobRecord,
    JobTimedOut,
    ShuttingDown,
    TimeLimit,
    unspool,
)
from app.engine.busy_workers import BusyWorkers
from app.engine.job import EngineJob
from app.engine.outcomes import Losses, error_of
from app.engine.process import WorkerGone, WorkerProcess
from app.engine.starting import kill_if_hung
from services.contract.operations import Operation
from services.contract.worker_facts import WorkerFacts
from services.errors import DocumentError
from services.progress import ProgressSink

T = TypeVar("T")
log = logging.getLogger(__name__)

RESTART_PAUSE_S = 1.0
"""Pause between two failed attempts to start a worker."""
MAX_RETRY_AFTER_S = 60


@dataclass(frozen=True, slots=True)
class PoolLimits:
    """Limits of the pool; `app.settings` documents each under the same name.

    `worker_memory_bytes` and `worker_resident_bytes` 0 mean no limit; a worker that does nothing for `start_timeout_s`
    while it starts is given up. Of the `processors` a busy worker uses those of idle ones too.
    """

    workers: int = 1
    processors: int = 1
    queue_length: int = 16
    job_timeout_s: float = 30.0
    queue_timeout_s: float = 30.0
    worker_memory_bytes: int = 0
    jobs_per_worker: int = 200
    worker_resident_bytes: int = 0
    start_timeout_s: float = 60.0


class _Seat:
    """One admission, counted from `admit` until the first `release`."""

    def __init__(self, engine: "LocalEngine") -> None:
        self._engine: LocalEngine | None = engine

    def release(self) -> None:
        engine, self._engine = self._engine, None
        if engine is not None:
            engine._admitted -= 1


class LocalEngine:
    """Pool of worker processes with limited admission, and limits on the time and memory of each job."""

    def __init__(
        self,
        limits: PoolLimits,
        warm_up: Operation[WorkerFacts] | None = None,
        warm_up_arguments: Sequence[object] = (),
        preload: Sequence[str] = (),
        observe: Callable[[JobRecord], None] = lambda record: None,
    ) -> None:
        """`warm_up(*warm_up_arguments)` runs in every new worker; modules of `preload` are imported once for all."""
        self._limits = limits
        self._warm_up = None if warm_up is None else (str(warm_up), tuple(warm_up_arguments))
        self._preload = list(preload)
        self._observe = observe
        self._jobs: deque[EngineJob] = deque()
        self._wake_ups: deque[asyncio.Future[None]] = deque()  # one future for each idle worker
        self._open: set[asyncio.Future[Any]] = set()  # answers that callers await
        self._workers: set[WorkerProcess] = set()
        self._tasks: list[asyncio.Task[None]] = []
        self._threads = ThreadPoolExecutor(limits.workers, thread_name_prefix="engine")
        self._draining = self._stopped = False
        self._facts = WorkerFacts()
        self._admitted = self._live = self._deaths = self._recycled = 0
        self._busy = BusyWorkers(min(limits.workers, limits.processors))
        self._mean_work_s = 1.0
        self._losses = Losses(limits.worker_memory_bytes)

    # The Engine interface

    async def start(self) -> None:
        # The libraries read these variables when the fork server loads them, before any worker exists.
        for name, value in inside.SINGLE_THREAD_ENVIRONMENT.items():
            os.environ.setdefault(name, value)
        multiprocessing.get_context("forkserver").set_forkserver_preload(self._preload)
        # Workers ignore SIGTERM, so multiprocessing would wait for them without end if the server exits early.
        atexit.register(self._kill_all)
        starts = await asyncio.gather(
            *(self._start_worker() for _ in range(self._limits.workers)), return_exceptions=True
        )
        workers = [worker for worker in starts if isinstance(worker, WorkerProcess)]
        if len(workers) < self._limits.workers:
            for worker in workers:
                await self._stop_worker(worker)
            failure = next(start for start in starts if isinstance(start, BaseException))
            raise EngineFailed(f"a worker did not start: {failure}")
        self._tasks = [asyncio.create_task(self._keep_one_worker(worker)) for worker in workers]

    def admit(self) -> _Seat:
        if self._draining:
            raise ShuttingDown("The service is shutting down. Send the request again.", 1)
        if self._admitted >= self._capacity:
            raise Busy(
                f"All {self._limits.workers} workers and the queue of {self._limits.queue_length} "
                "(QUEUE_LENGTH) are in use. Send the request again later.",
                self._retry_after_s(),
            )
        self._admitted += 1
        return _Seat(self)

    async def submit(
        self,
        operation: Operation[T],
        *arguments: object,
        time_limit: TimeLimit | None = None,
        progress: ProgressSink | None = None,
    ) -> T:
        if self._stopped:
            raise ShuttingDown("The service is shutting down. Send the request again.", 1)
        loop = asyncio.get_running_loop()
        job = EngineJob(
            str(operation),
            arguments,
            time_limit or TimeLimit(self._limits.job_timeout_s, "JOB_TIMEOUT_S"),
            progress,
            loop.create_future(),
            loop.create_future(),
        )
        self._open.add(job.answer)
        self._jobs.append(job)
        self._wake_idle_worker()
        try:
            await asyncio.wait(
                (job.started, job.answer),
                timeout=self._limits.queue_timeout_s,
                return_when=asyncio.FIRST_COMPLETED,
            )
            if not job.started.done() and not job.answer.done():
                self._observe(JobRecord(Busy.code, time.monotonic() - job.queued_at, 0.0))
                raise Busy(
                    f"No worker was free within {self._limits.queue_timeout_s:g} s (QUEUE_TIMEOUT_S). "
                    "Send the request again later.",
                    self._retry_after_s(),
                )
            return cast(T, await job.answer)
        finally:
            job.answer.cancel()  # stops the work if the caller was cancelled; no effect on a finished job
            self._open.discard(job.answer)
            if job in self._jobs:  # the error of `remove` would have all arguments of the job in words
                self._jobs.remove(job)

    def status(self) -> EngineStatus:
        return EngineStatus(
            ready=self._live > 0 and not self._draining,
            workers=self._limits.workers,
            live_workers=self._live,
            capacity=self._capacity,
            admitted=self._admitted,
            waiting=len(self._jobs),
            running=self._busy.count,
            worker_deaths=self._deaths,
            recycled_workers=self._recycled,
            facts=self._facts,
        )

    async def drain(self, grace_s: float) -> None:
        self._draining = True
        if self._open:
            await asyncio.wait(tuple(self._open), timeout=grace_s)
        self._stopped = True
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for answer in tuple(self._open):
            if not answer.done():
                answer.set_exception(ShuttingDown("The service is shutting down.", 1))
        self._threads.shutdown(wait=False)
        atexit.unregister(self._kill_all)

    # Internal

    @property
    def _capacity(self) -> int:
        return self._limits.workers + self._limits.queue_length

    def _retry_after_s(self) -> int:
        wait_s = self._mean_work_s * (len(self._jobs) + 1) / self._limits.workers
        return max(1, min(MAX_RETRY_AFTER_S, math.ceil(wait_s)))

    def _kill_all(self) -> None:
        for worker in tuple(self._workers):
            worker.kill()

    def _wake_idle_worker(self) -> None:
        """Wake the task of one idle worker."""
        while self._wake_ups:
            wake_up = self._wake_ups.popleft()
            if not wake_up.done():
                wake_up.set_result(None)
                return

    async def _keep_one_worker(self, worker: WorkerProcess) -> None:
        """Keep one place in the pool filled until the engine stops."""
        while True:
            try:
                await self._run_jobs(worker)
            finally:
                self._live -= 1
                code = await self._stop_worker(worker)
                log.info("worker ended", extra={"exit_code": code, "worker": worker.pid})
            while True:
                try:
                    worker = await self._start_worker()
                    break
                except Exception:
                    log.exception("worker did not start")
                    await asyncio.sleep(RESTART_PAUSE_S)

    async def _start_worker(self) -> WorkerProcess:
        worker = WorkerProcess(self._limits.worker_memory_bytes, self._warm_up, self._busy)
        self._workers.add(worker)
        loop = asyncio.get_running_loop()
        watching = asyncio.create_task(kill_if_hung(worker, self._limits.start_timeout_s))
        try:
            self._facts = await loop.run_in_executor(self._threads, worker.start)
        except BaseException as error:
            code = await self._stop_worker(worker)
            if isinstance(error, WorkerGone):
                raise EngineFailed(f"it ended during its warm-up (exit code {code})") from error
            raise
        finally:
            watching.cancel()
        self._live += 1
        return worker

    async def _stop_worker(self, worker: WorkerProcess) -> int | None:
        worker.kill()  # before anything else, so that no thread waits for it
        self._workers.discard(worker)
        return await asyncio.shield(asyncio.get_running_loop().run_in_executor(self._threads, worker.stop))

    async def _run_jobs(self, worker: WorkerProcess) -> None:
        """Give the worker one job after another, until it has died or reached its limit of jobs or of memory."""
        for _ in range(self._limits.jobs_per_worker):
            while not (job := self._next_job()):
                if not await self._wait_for_job(worker):
                    self._deaths += 1
                    log.warning("idle worker died", extra={"worker": worker.pid})
                    return
            self._busy.add(1)
            try:
                if not await self._run(worker, job):
                    return
            finally:
                self._busy.add(-1)
            if 0 < self._limits.worker_resident_bytes < worker.resident_bytes():
                break
        self._recycled += 1

    def _next_job(self) -> EngineJob | None:
        while self._jobs:
            job = self._jobs.popleft()
            if not job.answer.done():
                return job
        return None

    async def _wait_for_job(self, worker: WorkerProcess) -> bool:
        """True when there may be a job, False when the worker has died."""
        loop = asyncio.get_running_loop()
        wake_up: asyncio.Future[None] = loop.create_future()
        gone: asyncio.Future[None] = loop.create_future()
        self._wake_ups.append(wake_up)

        def on_death() -> None:
            if not gone.done():
                gone.set_result(None)

        loop.add_reader(worker.fileno(), on_death)
        try:
            await asyncio.wait((wake_up, gone), return_when=asyncio.FIRST_COMPLETED)
        finally:
            loop.remove_reader(worker.fileno())
            if wake_up.done():
                if gone.done():
                    self._wake_idle_worker()  # pass the announced job to another worker
            else:
                wake_up.cancel()
                self._wake_ups.remove(wake_up)
        return not gone.done()

    async def _run(self, worker: WorkerProcess, job: EngineJob) -> bool:
        """Run the job and set its answer; True if the worker can take another job."""
        loop = asyncio.get_running_loop()
        job.started.set_result(None)
        begin = time.monotonic()
        expired = False

        def expire() -> None:
            nonlocal expired
            expired = True
            worker.kill()

        def abandon(answer: "asyncio.Future[Any]") -> None:
            if answer.cancelled():
                worker.kill()

        timer: asyncio.TimerHandle | None = None
        error: DocumentError | None = None
        value: object = None
        usable = False
        try:
            job.tell(STARTED, 0.0)
            try:
                arguments = [await unspool(argument) for argument in job.arguments]
            except DocumentError as refusal:  # of what was spooled; the worker has not seen the job
                error, usable = refusal, True
                return usable
            if job.answer.done():
                return True
            # The timer covers the whole exchange, so that it also stops a worker that no longer reads or that
            # blocks while it sends its answer.
            timer = loop.call_later(job.time_limit.seconds, expire)
            job.answer.add_done_callback(abandon)
            outcome, value = await loop.run_in_executor(
                self._threads,
                worker.call,
                job.operation,
                arguments,
                job.time_limit.seconds,
                job.listener(loop),
            )
            usable = outcome in {inside.DONE, inside.REFUSED, inside.FAILED}
            error = error_of(outcome, value, self._limits.worker_memory_bytes)
        except WorkerGone as gone:
            error = self._error_of_loss(job, expired, gone.exit_code)
        except asyncio.CancelledError:
            error = ShuttingDown("The service stopped before the work was done. Send the request again.", 1)
            raise
        except Exception as unforeseen:
            log.exception("exchange with a worker failed")
            error = JobFailed(f"{type(unforeseen).__name__}: {unforeseen}")
        finally:
            if timer is not None:
                timer.cancel()
            self._settle(job, value, error, begin)
        return usable

    def _error_of_loss(self, job: EngineJob, expired: bool, exit_code: int | None) -> DocumentError | None:
        if job.answer.cancelled():
            return None  # the caller was cancelled, so the worker was stopped
        if expired:
            return JobTimedOut(
                f"The work exceeded its limit of {job.time_limit.seconds:g} s ({job.time_limit.setting}) "
                "and was stopped."
            )
        self._deaths += 1
        return self._losses.error_of(exit_code)

    def _settle(self, job: EngineJob, value: object, error: DocumentError | None, begin: float) -> None:
        """Set the answer or error of the job, and record its times."""
        work_s = time.monotonic() - begin
        outcome = "cancelled" if job.answer.cancelled() else error.code if error is not None else "done"
        if not job.answer.done():
            if error is not None:
                job.answer.set_exception(error)
            else:
                job.answer.set_result(value)
        if outcome == "done":
            self._mean_work_s += 0.1 * (work_s - self._mean_work_s)
        self._observe(JobRecord(outcome, begin - job.queued_at, work_s))
