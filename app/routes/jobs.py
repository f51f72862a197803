"""/jobs: state, result and cancellation of long work."""

from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Header, Request, Response
from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from app.access.callers import caller_of
from app.http.problems import documented, problem_response
from app.jobs.registry import JobCancelled, Jobs
from app.routes.common_responses import IMAGE, STORE, WORK
from app.routes.layout import HEADERS as LAYOUT_HEADERS
from app.routes.long_work import status_of
from app.routes.page_answers import MOSAIC_HEADERS, RECTIFY_HEADERS
from app.schemas.jobs import JobStatus
from app.schemas.options import Absent
from app.state import State
from models.job_records import StoredJob
from services.contract.images import MEDIA_TYPES as PAGES_MEDIA_TYPES

router = APIRouter(prefix="/jobs/{id}", tags=["jobs"])

_JSON_RESULTS = [
    {"$ref": f"#/components/schemas/{name}"}
    for name in (
        "RectifyResult",
        "PagesResult",
        "MosaicResult",
        "LayoutResult",
        "DocumentResult",
        "StackResult",
        "InitializedModel",
        "TrainedModel",
        "Proposals",
        "SamplesReport",
        "ImportReport",
        "PlainPagesResult",
        "PlainMosaicResult",
    )
]
_POLLING = {
    "headers": {
        "Retry-After": {
            "description": "While the work lasts: seconds until the next request makes sense.",
            "schema": {"type": "integer", "minimum": 1},
        }
    }
}
_BINARY_RESULTS = sorted({*PAGES_MEDIA_TYPES.values(), "image/png"} - {"application/json"})


@router.get("", operation_id="job", responses={200: _POLLING, **documented("not-found", "internal", *STORE)})
async def job(request: Request, response: Response, state: State, id: str) -> JobStatus:
    """The state of the job. It is kept for JOB_TTL_S seconds after the job's end, also when the service restarts."""
    status = status_of(await _own_job(request, state, id), state.settings.root_path)
    if status.poll_after_s is not None:
        response.headers["Retry-After"] = str(status.poll_after_s)
    return status


@router.get(
    "/events",
    operation_id="job_events",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "Server-sent events: a JobStatus as `data` at once and after every change. "
            "The stream ends when the job ends.",
            "content": {"text/event-stream": {"schema": {"type": "string"}}},
        },
        204: {"description": "`Last-Event-ID` is that of the last event; no more events follow."},
        **documented("not-found", "internal", "busy", *STORE),
    },
)
async def job_events(
    request: Request,
    state: State,
    id: str,
    last_event_id: Annotated[
        str | Absent, Header(description="Sent by browsers when they reconnect.")
    ] = None,
) -> Response:
    """Stream of the job's states: as GET /jobs/{id}, after each change."""
    found = await _own_job(request, state, id)
    if found.is_over and last_event_id == str(found.revision):
        return Response(status_code=204)  # a browser would reconnect without end
    return _EventStream(state.jobs, found, state.settings.root_path)


@router.get(
    "/result",
    operation_id="job_result",
    response_class=Response,
    responses={
        200: {
            "description": "The response that the request would have received without a job: its status, headers and "
            "body. For a failed job this is the problem; its `request_id` is that of the request.",
            "content": {
                "application/json": {"schema": {"anyOf": _JSON_RESULTS}},
                **{name: {"schema": {"type": "string", "format": "binary"}} for name in _BINARY_RESULTS},
                **{name: {"schema": {"type": "string"}} for name in ("application/xml", "text/html")},
            },
            "headers": RECTIFY_HEADERS | MOSAIC_HEADERS | LAYOUT_HEADERS,
        },
        **documented(
            "not-found",
            "not-finished",
            "cancelled",
            "conflict",
            "store-full",
            "too-large",
            "no-text",
            "not-overlapping",
            "invalid-model",
            "no-samples",
            *IMAGE,
            *STORE,
            *WORK,
            conditional=True,
        ),
    },
)
async def job_result(request: Request, state: State, id: str) -> Response:
    """The response of the job, as if the request had waited for it."""
    return await state.jobs.answer(await _own_job(request, state, id))


@router.delete(
    "",
    operation_id="cancel_job",
    status_code=204,
    response_class=Response,
    responses=documented("not-found", "internal", *STORE),
)
async def cancel_job(request: Request, state: State, id: str) -> None:
    """Cancel the job: its work is stopped. A finished job is deleted, with its result.

    Anything that the work has already written (a version of a model) remains.
    """
    found = await _own_job(request, state, id)
    if found.is_over:
        await state.jobs.delete(found)
    else:
        problem = problem_response(JobCancelled("The job was cancelled."), request.scope)
        await state.jobs.cancel(found, problem)


async def _own_job(request: Request, state: State, id: str) -> StoredJob:
    caller = caller_of(request)
    return await state.jobs.find(id, caller.name, sees_all=caller.sees_all)


class _EventStream(StreamingResponse):
    """Server-sent events of one job; the number of such streams is limited."""

    def __init__(self, jobs: Jobs, job: StoredJob, root_path: str) -> None:
        super().__init__(
            _events(jobs, job, root_path),
            # Proxies must not buffer events.
            headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
            media_type="text/event-stream",
        )
        jobs.followers.enter()
        self._followers = jobs.followers

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._followers.leave()


async def _events(jobs: Jobs, job: StoredJob, root_path: str) -> AsyncIterator[str]:
    async for changed in jobs.followers.follow(job):
        if changed is not None:
            yield f"id: {changed.revision}\ndata: {status_of(changed, root_path).model_dump_json()}\n\n"
        else:
            yield ": still there\n\n"
