"""What runs the jobs of one process: made with the app, started and stopped with it."""

import asyncio
from collections.abc import AsyncIterator
from typing import Any

from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from fastapi.middleware.asyncexitstack import AsyncExitStackMiddleware
from starlette.exceptions import HTTPException
from starlette.middleware.exceptions import ExceptionMiddleware
from starlette.responses import Response
from starlette.types import ASGIApp

from app.access.audit import Audit
from app.http.problems import FrameworkErrors, ProblemBoundary, problem_response
from app.jobs.callbacks import Callbacks, CallbackSettings
from app.jobs.changes import ChangeListener
from app.jobs.dispatch import Dispatch, Housekeeping, LocalDispatch
from app.jobs.queue import QueueDispatch
from app.jobs.registry import JobLimits, Jobs, JobWork
from app.jobs.running import JobRunner, RunLimits
from app.jobs.shared_blobs import LOOK_EVERY_S, SharedBlobs
from app.jobs.stored_request import JobRun, do_request
from app.metrics import JobFacts
from app.settings import Settings
from app.storage.blobs import BlobAccess
from app.storage.layout_store import LayoutStore
from models.errors import StoreError
from models.job_records import QueueStatus, RequestJson

QUEUE_TIMEOUT_S = 1.0
"""Time for the numbers of the queue, without which metrics are served too."""


class JobService:
    """Runs jobs, and keeps their rows and blobs clean."""

    def __init__(
        self,
        app: FastAPI,
        answer: FrameworkErrors,
        store: LayoutStore,
        blobs: BlobAccess,
        settings: Settings,
    ) -> None:
        """`answer` handles the framework's errors of `app`, by whose routes the jobs are done."""
        routes = _without_middleware(app, answer)

        async def do(request: RequestJson, body: AsyncIterator[bytes], run: JobRun) -> Response:
            return await do_request(routes, app, request, body, run)

        self._store = store
        self._queue: QueueStatus | None = None
        self._runner = JobRunner(
            store,
            blobs,
            do,
            _tell,
            RunLimits(settings.job_ttl_s, settings.max_job_result_bytes, settings.job_lease_s),
        )
        self.dispatch: Dispatch = (
            QueueDispatch(settings.database_url, self._runner, settings.workers)
            if settings.database_url
            else LocalDispatch(self._runner, settings.workers)
        )
        work = JobWork(self.dispatch.enlist, self.dispatch.announce, self._runner.abandon)
        self.jobs = Jobs(store, blobs, job_limits(settings), work)
        self.shared_blobs = SharedBlobs(store, blobs)
        looks = [(LOOK_EVERY_S, self.shared_blobs.look)] if settings.database_url else []
        self._housekeeping = Housekeeping(self.jobs, self._runner, self.dispatch, *looks)
        self.callbacks = Callbacks(
            store,
            CallbackSettings(
                settings.callback_hosts,
                settings.callback_internal_hosts,
                settings.callback_secret,
                settings.root_path,
            ),
        )
        self._changes = (
            ChangeListener(settings.database_url, self.jobs.followers) if settings.database_url else None
        )

    async def read_queue(self) -> None:
        """Read the numbers of the queue for `facts`."""
        try:
            async with asyncio.timeout(QUEUE_TIMEOUT_S):
                self._queue = await self._store.call(lambda store: store.queue_status())
        except (StoreError, TimeoutError):
            self._queue = None

    def facts(self) -> JobFacts:
        """Figures of jobs for the metrics; the queue as `read_queue` found it."""
        runner = self._runner
        return JobFacts(self._queue, runner.starts, runner.leases_lost, self.callbacks.failures)

    async def start(self) -> None:
        """Begin to run jobs."""
        await self.dispatch.start()
        if self._changes is not None:
            self._changes.start()
        self._housekeeping.start()
        self.callbacks.start()

    async def stop(self, grace_s: float) -> None:
        """Take no more jobs. Those that still run after `grace_s` seconds are handed back."""
        self.jobs.followers.close()
        if self._changes is not None:
            await self._changes.stop()
        await self.callbacks.stop()
        await self._housekeeping.stop()
        await self.dispatch.stop(grace_s)
        await self.shared_blobs.leave()


def _tell(error: Exception, request_id: str) -> Response:
    return problem_response(error, {"state": {"request_id": request_id}})


def _without_middleware(app: FastAPI, answer: FrameworkErrors) -> ASGIApp:
    """The routes as an application for requests that the middleware has admitted before.

    Its answers are complete: no part is compressed, or left out because the client has it already.
    """
    handlers: dict[Any, Any] = {HTTPException: answer, RequestValidationError: answer}
    return ProblemBoundary(ExceptionMiddleware(Audit(AsyncExitStackMiddleware(app.router)), handlers))


def job_limits(settings: Settings) -> JobLimits:
    """The limits of jobs in the settings."""
    return JobLimits(
        ttl_s=settings.job_ttl_s,
        max_jobs=settings.max_jobs,
        max_jobs_per_key=settings.most_jobs_per_key,
        max_input_bytes=settings.max_job_input_bytes,
        max_result_bytes=settings.max_job_result_bytes,
        max_listeners=settings.max_job_listeners,
    )
