"""Admission of requests to the queue of jobs, and requests that wait for workers elsewhere."""

import asyncio
import tempfile
from collections.abc import Collection, Iterator
from typing import IO

from anyio import to_thread
from fastapi import Request
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.engine.base import Busy
from app.http.connection import while_connected
from app.http.form_parts import READ_BYTES
from app.http.paths import PathTemplates
from app.http.problems import problem_response
from app.http.upload_places import UploadPlaces
from app.http.uploads import IS_JOB, ClientGone
from app.http.wishes import prefers_async
from app.jobs.registry import KEY_HEADER, JobCancelled, Jobs
from app.jobs.stored_request import describe_request
from models.job_records import StoredJob

_IN_MEMORY_BYTES = 256 * 1024
BEFORE_JOBS = 1
"""Priority of requests whose clients wait for the answer."""


class JobAdmission:
    """Middleware: a full queue of jobs refuses before the body is read.

    Without workers of its own (`forwards`), the service stores every request for work as a job that is first in the
    queue, waits for its end, and deletes it. Where the client prefers a job, the route stores it.
    """

    def __init__(
        self,
        app: ASGIApp,
        jobs: Jobs,
        work: Collection[tuple[str, str]],
        later: Collection[tuple[str, str]],
        places: UploadPlaces,
        queue_timeout_s: float,
        *,
        forwards: bool,
    ) -> None:
        """`work` and `later` are pairs of method and path template: requests for work, and those that may be jobs."""
        self.app = app
        self.jobs = jobs
        self.work = frozenset(work)
        self.later = frozenset(later)
        self.templates = PathTemplates(template for _, template in work)
        self.places = places
        self.queue_timeout_s = queue_timeout_s
        self.forwards = forwards

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or (scope["method"], self.templates.match(scope["path"])) not in self.work:
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        is_job = (scope["method"], self.templates.match(scope["path"])) in self.later and prefers_async(
            headers
        )
        scope["state"][IS_JOB] = is_job
        if is_job or self.forwards:
            length = headers.get("content-length", "")
            await self.jobs.require_room(
                scope["state"]["caller"],
                int(length) if length.isascii() and length.isdigit() else 0,
                headers.get(KEY_HEADER) if is_job else None,
            )
        if is_job or not self.forwards:
            await self.app(scope, receive, send)
            return
        request = Request(scope)
        job = await self._store(request, receive)
        try:
            job = await while_connected(receive, self._wait(job))
            response = await self.jobs.answer(job)
            await response(scope, receive, send)
        finally:  # after the answer, which must not wait for it
            await asyncio.shield(self._forget(request, job))

    async def _store(self, request: Request, receive: Receive) -> StoredJob:
        with tempfile.SpooledTemporaryFile(_IN_MEMORY_BYTES) as file:
            size = await self._spool(receive, file)
            file.seek(0)
            description = describe_request(request, request.headers.get("content-type"))
            return await self.jobs.store_job(
                description, _parts(file), size, description["caller"], "request", priority=BEFORE_JOBS
            )

    async def _spool(self, receive: Receive, file: IO[bytes]) -> int:
        place, size = self.places.enter(), 0
        try:
            while True:
                message: Message = await place.receive(receive)
                if message["type"] == "http.disconnect":
                    raise ClientGone("The client closed the connection before the body was there.")
                if body := message.get("body", b""):
                    size += len(body)
                    await to_thread.run_sync(file.write, body)
                if not message.get("more_body", False):
                    return size
        finally:
            place.leave()

    async def _wait(self, job: StoredJob) -> StoredJob:
        """The job at its end. Raises `Busy` when no worker takes it in time, also after one has handed it back."""
        try:
            async with asyncio.timeout(self.queue_timeout_s) as waiting:
                async for changed in self.jobs.followers.follow(job):
                    if changed is None or changed.state == job.state:
                        continue
                    if changed.is_over:
                        return changed
                    job = changed
                    # While it runs, the worker's own limits hold.
                    is_queued = job.state == "queued"
                    now_s = asyncio.get_running_loop().time()
                    waiting.reschedule(now_s + self.queue_timeout_s if is_queued else None)
        except TimeoutError:
            raise Busy(
                f"No worker was free within {self.queue_timeout_s:g} s (QUEUE_TIMEOUT_S). "
                "Send the request again later."
            ) from None
        raise Busy("The service is stopping. Send the request again.")

    async def _forget(self, request: Request, job: StoredJob) -> None:
        if not job.is_over:
            problem = problem_response(JobCancelled("The client no longer waits."), request.scope)
            await self.jobs.cancel(job, problem)
        await self.jobs.delete(job)


def _parts(file: IO[bytes]) -> Iterator[bytes]:
    while part := file.read(READ_BYTES):
        yield part
