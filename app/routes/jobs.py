"""/jobs: state and result of long work, and its cancellation."""

from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Header, Request, Response
from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from app.jobs import Job, Jobs
from app.problems import documented
from app.routes.common_responses import IMAGE, STORE, WORK
from app.routes.long_work import owner_of, status_of
from app.routes.state import State
from app.schemas.jobs import JobStatus
from app.schemas.options import Absent

router = APIRouter(prefix="/jobs/{id}", tags=["jobs"])


@router.get("", operation_id="job", responses=documented("not-found", "internal"))
async def job(request: Request, state: State, id: str) -> JobStatus:
    """How the job stands; kept for JOB_TTL_S seconds after its end, and until the service is started again."""
    return status_of(state.jobs.find(id, owner_of(request, state.settings)))


@router.get(
    "/events",
    operation_id="job_events",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "Server-sent events: a JobStatus as `data` at once and with every change, the last one when "
            "the job is over. Then the stream ends.",
            "content": {"text/event-stream": {"schema": {"type": "string"}}},
        },
        204: {"description": "`Last-Event-ID` is that of the last event; there will be no more."},
        **documented("not-found", "internal", "busy"),
    },
)
async def job_events(
    request: Request,
    state: State,
    id: str,
    last_event_id: Annotated[
        str | Absent, Header(description="Browsers send it when they connect again.")
    ] = None,
) -> Response:
    """Listen to the job: the same as GET /jobs/{id}, told when it changes."""
    found = state.jobs.find(id, owner_of(request, state.settings))
    if found.is_over and last_event_id == str(found.revision):
        return Response(status_code=204)  # a browser would come again for ever
    return _EventStream(state.jobs, found)


@router.get(
    "/result",
    operation_id="job_result",
    response_class=Response,
    responses={
        200: {
            "description": "What the request would have been answered with: its status, headers and body. So are the "
            "problems of a job that failed; their `request_id` is that of the request.",
            "content": {"*/*": {}},
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
    """The answer, as if the request had waited for it."""
    return await state.jobs.answer(state.jobs.find(id, owner_of(request, state.settings)))


@router.delete("", operation_id="cancel_job", status_code=204, responses=documented("not-found", "internal"))
async def cancel_job(request: Request, state: State, id: str) -> None:
    """Cancel the job: its work is stopped. One that is over stays as it is.

    What the work has written already (a version of a model) stays written.
    """
    await state.jobs.cancel(state.jobs.find(id, owner_of(request, state.settings)))


class _EventStream(StreamingResponse):
    """Server-sent events of one job; one of a bounded number of streams."""

    def __init__(self, jobs: Jobs, job: Job) -> None:
        super().__init__(
            _events(jobs, job),
            # A proxy that gathered events before it passes them on would make them useless.
            headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
            media_type="text/event-stream",
        )
        jobs.enter_listener()
        self._jobs = jobs

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._jobs.leave_listener()


async def _events(jobs: Jobs, job: Job) -> AsyncIterator[str]:
    async for has_changed in jobs.follow(job):
        if has_changed:
            yield f"id: {job.revision}\ndata: {status_of(job).model_dump_json()}\n\n"
        else:
            yield ": still there\n\n"
