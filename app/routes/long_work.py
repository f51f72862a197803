"""`Prefer: respond-async` (RFC 7240): the same work and the same answer, now or later."""

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
        "description": "With `Prefer: respond-async`: the work goes on as a job; `Location` says where to ask for it.",
        "model": JobStatus,
        "headers": {
            "Location": {"description": "The job's path.", "schema": {"type": "string"}},
            "Preference-Applied": {"schema": {"type": "string", "enum": [RESPOND_ASYNC]}},
        },
    }
}
"""OpenAPI response of a route that may answer later."""
PREFER: dict[str, Any] = {
    "parameters": [
        {
            "name": "Prefer",
            "in": "header",
            "required": False,
            "description": f"`{RESPOND_ASYNC}`: accept the work now, answer at /jobs/{{id}}/result.",
            "schema": {"type": "string"},
            "example": RESPOND_ASYNC,
        }
    ]
}
"""OpenAPI parameters of such a route."""


async def answer_now_or_later(request: Request, state: AppState, work: Work) -> Response:
    """The answer of `work`; if the client prefers that, 202 and a job whose result will be this answer.

    `work` hands its sink on to `Engine.submit`; without a job it is None, and the work stops when the client leaves.
    What the request brought (its files) and its seat are there until the work has ended, either way. What can be
    judged at once should be judged before this, so that a client is not sent away with a job that cannot succeed.

    Raises
    ------
    ClientGone
        When the client left before the answer.
    Busy
        When there are as many unfinished jobs as there may be.
    """
    if not prefers_async(request.headers):
        return await while_connected(request, work(None))
    tell = partial(problem_response, scope=request.scope)
    job = state.jobs.start(work, owner_of(request, state.settings), tell)
    return _Accepted(job)


def prefers_async(headers: Headers) -> bool:
    """Whether one of the client's preferences is to be answered later."""
    preferences = ",".join(headers.getlist("prefer")).split(",")
    return any(
        preference.partition(";")[0].partition("=")[0].strip().lower() == RESPOND_ASYNC
        for preference in preferences
    )


def owner_of(request: Request, settings: Settings) -> str | None:
    """The API key that a request's jobs belong to; None where there are no keys."""
    return request.headers.get(API_KEY_HEADER) if settings.api_keys else None


def status_of(job: Job) -> JobStatus:
    """The job as it is told."""
    return JobStatus.model_validate(job, from_attributes=True)


class _Accepted(Response):
    """202 at once; the request ends, and gives back its files and its seat, with its job.

    So the job is one of the requests in flight that the server waits for when it stops.
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
