"""`Prefer: respond-async` (RFC 7240): the response is sent after the work, or the work becomes a job."""

from collections.abc import Callable, Coroutine
from dataclasses import asdict
from typing import Any

from fastapi import Request, Response
from starlette.datastructures import Headers

from app.access.callers import caller_of
from app.http.connection import while_connected
from app.http.form_parts import has_form
from app.http.sent_request import digest_of
from app.http.wishes import RESPOND_ASYNC, prefers_async
from app.jobs.callback_request import parse_callback_url
from app.jobs.registry import KEY_HEADER, Repeatable
from app.jobs.stored_request import RUN, JobRun
from app.schemas.jobs import JobDelivery, JobLinks, JobStatus
from app.state import AppState
from models.job_records import StoredJob
from models.records import MAX_NAME
from services.contract.answers.problem import Problem
from services.errors import InvalidOption
from services.progress import ProgressSink

Work = Callable[[ProgressSink | None], Coroutine[Any, Any, Response]]
"""Coroutine that answers a request. It passes the sink to `Engine.submit`; None: progress is not reported."""

ACCEPTED_STATUS = 202
CALLBACK = "callback_url"
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
PREFER = {
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
            "schema": {"type": "string", "minLength": 1, "maxLength": MAX_NAME},
        },
    ]
}
"""OpenAPI parameters of such a route."""


async def answer_now_or_later(request: Request, state: AppState, work: Work) -> Response:
    """Response of `work`; if the client prefers a job, 202 and a job whose result will be this response.

    A job is the stored request. It comes here again, without the preference, when it is its turn. Checks that need no
    work should come before this call, so that no job starts that cannot succeed.

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
        When the queue of jobs is full.
    KeyReused
        When the Idempotency-Key came with a different request before.
    """
    run: JobRun | None = getattr(request.state, RUN, None)
    if run is not None:
        return await work(run.report)
    key, callback_url = _key_of(request.headers), await _callback_url(request, state)
    if not prefers_async(request.headers):
        return await while_connected(request.receive, work(None))
    request.state.seat.release()
    owner, root_path = caller_of(request).name, state.settings.root_path
    repeated: Repeatable | None = None
    if key is not None:
        repeated = Repeatable(key, await digest_of(request))
        if (earlier := await state.jobs.repeated(repeated, owner)) is not None:
            return _accepted(earlier, root_path)
    return _accepted(await state.jobs.accept(request, owner, repeated, callback_url), root_path)


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
    if key is not None and not 1 <= len(key) <= MAX_NAME:
        raise InvalidOption(f"{KEY_HEADER}: send a key of 1 to {MAX_NAME} characters.", KEY_HEADER)
    return key


async def _callback_url(request: Request, state: AppState) -> str | None:
    """The `callback_url` of the request, in the query or in the form.

    Raises
    ------
    InvalidOption
        When it is not allowed, or comes without the preference for a job.
    """
    sent = {request.query_params[CALLBACK]} if CALLBACK in request.query_params else set()
    if has_form(request.headers):
        sent |= {str(value) for value in (await request.form()).getlist(CALLBACK)}
    urls = sent - {""}
    if not urls:
        return None
    if len(urls) > 1:
        raise InvalidOption(f"{CALLBACK}: the query and the form have different ones; send one.", CALLBACK)
    if not prefers_async(request.headers):
        raise InvalidOption(f"{CALLBACK}: send it with `Prefer: {RESPOND_ASYNC}`.", CALLBACK)
    url = urls.pop()
    parse_callback_url(url, state.settings.callback_hosts)
    return url


def status_of(job: StoredJob, root_path: str) -> JobStatus:
    """State of the job as a part of responses; `root_path` is the prefix of all paths as clients see them."""
    path = f"{root_path}/jobs/{job.id}"
    return JobStatus(
        id=job.id,
        state=job.state,
        stage=job.stage,
        progress=round(job.progress, 3),
        attempts=job.attempts,
        created=job.created_at,
        started=job.started_at,
        ended=job.ended_at,
        problem=None if job.problem is None else Problem.model_validate(job.problem),
        links=JobLinks(result=f"{path}/result", events=f"{path}/events"),
        poll_after_s=None if job.is_over else POLL_AFTER_S,
        callback_url=job.callback_url,
        deliveries=[JobDelivery(**asdict(each)) for each in job.deliveries],
    )


def _accepted(job: StoredJob, root_path: str) -> Response:
    """202 for a job that exists."""
    headers = {"Location": f"/jobs/{job.id}", "Preference-Applied": RESPOND_ASYNC}
    return Response(status_of(job, root_path).model_dump_json(), ACCEPTED_STATUS, headers, "application/json")
