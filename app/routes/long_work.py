"""`Prefer: respond-async` (RFC 7240): the response is sent after the work, or the work becomes a job."""

from functools import partial
from typing import Any

from fastapi import Request, Response
from starlette.datastructures import Headers
from starlette.types import Receive, Scope, Send

from app.authentication import HEADER as API_KEY_HEADER
from app.jobs import Job, Work
from app.problems import problem_response
from app.routes.connection import while_connected
from app.routes.state import AppState
from app.schemas.jobs import JobStatus
from app.settings import Settings

RESPOND_ASYNC = "respond-async"
ACCEPTED: dict[int | str, dict[str, Any]] = {
    202: {
        "description": "With `Prefer: respond-async`: the work continues as a job; `Location` is its path.",
        "model": JobStatus,
        "headers": {
            "Location": {"description": "The job's path.", "schema": {"type": "string"}},
            "Preference-Applied": {"schema": {"type": "string", "enum": [RESPOND_ASYNC]}},
        },
    }
}
"""OpenAPI response of a route that may start a job."""
PREFER: dict[str, Any] = {
    "parameters": [
        {
            "name": "Prefer",
            "in": "header",
            "required": False,
            "description": f"`{RESPOND_ASYNC}`: accept the work now, respond at /jobs/{{id}}/result.",
            "schema": {"type": "string"},
            "example": RESPOND_ASYNC,
        }
    ]
}
"""OpenAPI parameters of such a route."""


async def answer_now_or_later(request: Request, state: AppState, work: Work) -> Response:
    """Response of `work`; if the client prefers a job, 202 and a job whose result will be this response.

    The uploaded files and the seat remain available until the work has ended, in both cases. Checks that need no work
    should come before this call, so that no job starts that cannot succeed.

    Parameters
    ----------
    request, state
        The request, and the state of its app.
    work
        Takes the progress sink for `Engine.submit`. Without a job the sink is None, and the work is cancelled when the
        client disconnects.

    Raises
    ------
    ClientGone
        When the client disconnected before the response.
    Busy
        When the number of unfinished jobs is at its limit.
    """
    if not prefers_async(request.headers):
        return await while_connected(request, work(None))
    tell = partial(problem_response, scope=request.scope)
    job = state.jobs.start(work, owner_of(request, state.settings), tell)
    return _Accepted(job)


def prefers_async(headers: Headers) -> bool:
    """Whether the client prefers a job (`respond-async`)."""
    preferences = ",".join(headers.getlist("prefer")).split(",")
    return any(
        preference.partition(";")[0].partition("=")[0].strip().lower() == RESPOND_ASYNC
        for preference in preferences
    )


def owner_of(request: Request, settings: Settings) -> str | None:
    """API key that owns the request's jobs; None if the service has no keys."""
    return request.headers.get(API_KEY_HEADER) if settings.api_keys else None


def status_of(job: Job) -> JobStatus:
    """State of the job as a part of responses."""
    return JobStatus.model_validate(job, from_attributes=True)


class _Accepted(Response):
    """202 at once. The request itself ends with its job, and then releases its files and its seat.

    Therefore the server waits for the job at shutdown, as for any request in progress.
    """

    def __init__(self, job: Job) -> None:
        super().__init__(
            status_of(job).model_dump_json(),
            202,
            {"Location": f"/jobs/{job.id}", "Preference-Applied": RESPOND_ASYNC},
            "application/json",
        )
        self._job = job

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
            await self._job.wait()
        finally:
            self._job.abandon()
