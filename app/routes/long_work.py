"""`Prefer: respond-async` (RFC 7240): the response is sent after the work, or the work becomes a job."""

from functools import partial
from typing import Any

from fastapi import Request, Response
from starlette.datastructures import Headers
from starlette.types import Receive, Scope, Send

from app.callers import caller_of
from app.jobs import MOST_KEY_CHARACTERS, Job, Repeatable, Work
from app.problems import problem_response
from app.routes.connection import while_connected
from app.routes.sent_request import digest_of
from app.routes.state import AppState
from app.schemas.jobs import JobLinks, JobStatus
from app.schemas.problem import Problem
from services.errors import InvalidOption

RESPOND_ASYNC = "respond-async"
ACCEPTED_STATUS = 202
KEY_HEADER = "Idempotency-Key"
POLL_AFTER_S = 1
"""Advice for clients that poll: the shortest work takes about this long."""
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
        },
        {
            "name": KEY_HEADER,
            "in": "header",
            "required": False,
            "description": f"With `Prefer: {RESPOND_ASYNC}`: a repeated request with the same key gets the same job. "
            "Send a new random key for new work.",
            "schema": {"type": "string", "minLength": 1, "maxLength": MOST_KEY_CHARACTERS},
        },
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
    KeyReused
        When the Idempotency-Key came with a different request before.
    """
    key = _key_of(request.headers)
    if not prefers_async(request.headers):
        return await while_connected(request, work(None))
    owner, root_path = caller_of(request).name, state.settings.root_path
    repeated: Repeatable | None = None
    if key is not None:
        repeated = Repeatable(key, await digest_of(request))
        if (earlier := state.jobs.repeated(repeated, owner)) is not None:
            return _accepted(earlier, root_path)
    tell = partial(problem_response, scope=request.scope)
    return _Accepted(state.jobs.start(work, owner, tell, repeated), root_path)


async def check_key(request: Request) -> None:
    """Dependency of routes with other preconditions: the Idempotency-Key is judged before them.

    Raises
    ------
    InvalidOption
    """
    _key_of(request.headers)


def _key_of(headers: Headers) -> str | None:
    """The Idempotency-Key of the request.

    Raises
    ------
    InvalidOption
        When it is empty or too long, also where no job is wanted: a client should learn that early.
    """
    key = headers.get(KEY_HEADER)
    if key is not None and not 1 <= len(key) <= MOST_KEY_CHARACTERS:
        raise InvalidOption(f"{KEY_HEADER}: send a key of 1 to {MOST_KEY_CHARACTERS} characters.", KEY_HEADER)
    return key


def prefers_async(headers: Headers) -> bool:
    """Whether the client prefers a job (`respond-async`)."""
    preferences = ",".join(headers.getlist("prefer")).split(",")
    return any(
        preference.partition(";")[0].partition("=")[0].strip().lower() == RESPOND_ASYNC
        for preference in preferences
    )


def status_of(job: Job, root_path: str) -> JobStatus:
    """State of the job as a part of responses; `root_path` is the prefix of all paths as clients see them."""
    path = f"{root_path}/jobs/{job.id}"
    return JobStatus(
        id=job.id,
        state=job.state,
        stage=job.stage,
        progress=round(job.progress, 3),
        created=job.created,
        started=job.started,
        ended=job.ended,
        problem=None if job.problem is None else Problem.model_validate(job.problem),
        links=JobLinks(result=f"{path}/result", events=f"{path}/events"),
        poll_after_s=None if job.is_over else POLL_AFTER_S,
    )


def _accepted(job: Job, root_path: str) -> Response:
    """202 for a job that exists."""
    headers = {"Location": f"/jobs/{job.id}", "Preference-Applied": RESPOND_ASYNC}
    return Response(status_of(job, root_path).model_dump_json(), ACCEPTED_STATUS, headers, "application/json")


class _Accepted(Response):
    """202 at once. The request itself ends with its job, and then releases its files and its seat.

    Therefore the server waits for the job at shutdown, as for any request in progress.
    """

    def __init__(self, job: Job, root_path: str) -> None:
        accepted = _accepted(job, root_path)
        super().__init__(accepted.body, accepted.status_code)
        self.raw_headers = accepted.raw_headers
        self._job = job

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
            await self._job.wait()
        finally:
            self._job.abandon()
