"""Liveness, readiness and metrics."""

import asyncio
from typing import Literal

from fastapi import APIRouter, Response

from app.engine.base import EngineStatus
from app.http.problems import documented
from app.metrics import MEDIA_TYPE
from app.schemas.health import Live, Ready
from app.state import AppState, State
from services.errors import DocumentError

DISK_TIMEOUT_S = 0.2
"""Time for the check of the disk; a network file system may hang."""
router = APIRouter(tags=["health"])


class NotReady(DocumentError):
    """No worker is ready."""

    code = "not-ready"


@router.get("/health/live", operation_id="live")
async def live() -> Live:
    """Returns 200 while the server process runs."""
    return Live()


@router.get("/health/ready", operation_id="ready", responses=documented("not-ready"))
async def ready(state: State) -> Ready:
    """Returns 200 when workers have warmed up."""
    status: EngineStatus = state.engine.status()
    disk, store, blobs, runners = await asyncio.gather(
        state.disk.is_enough(DISK_TIMEOUT_S),
        state.store.is_available(),
        state.blobs.is_available(),
        state.job_service.dispatch.live_workers(),
    )
    if not status.ready or (not status.workers and not runners):
        raise NotReady("No worker is ready; work that is sent now would wait.")
    return Ready(
        live_workers=status.live_workers,
        workers=status.workers,
        admitted=status.admitted,
        capacity=status.capacity,
        ocr=status.facts.ocr,
        languages=list(status.facts.languages),
        disk="ready" if disk else "full",
        store="ready" if store else "unavailable",
        blobs=_state_of_blobs(state) if blobs else "unavailable",
        queue="unavailable" if runners is None else "ready",
        job_runners=runners,
    )


def _state_of_blobs(state: AppState) -> Literal["ready", "not-shared"]:
    return "ready" if state.job_service.shared_blobs.are_shared else "not-shared"


@router.get(
    "/metrics",
    operation_id="metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
)
async def metrics(state: State) -> Response:
    """Counters and gauges in Prometheus' text format."""
    await state.job_service.read_queue()
    return Response(state.metrics.exposition(), headers={"Content-Type": MEDIA_TYPE})
