"""Cameras whose focal lengths are remembered."""

from fastapi import APIRouter, Request, Response

from app.access.callers import caller_of
from app.http.problems import documented
from app.routes.common_responses import READING, STORE
from app.schemas.cameras import CameraList, RememberedCamera
from app.state import State
from models.errors import CameraNotFound

router = APIRouter(prefix="/cameras", tags=["rectify"])


@router.get("", operation_id="list_cameras", responses=documented(*STORE))
async def list_cameras(request: Request, state: State) -> CameraList:
    """List the cameras of this key, the last used one first: their focal lengths decide where a page shows none."""
    caller = caller_of(request)
    found = await state.store.call(lambda store: store.cameras(caller.name))
    return CameraList(
        cameras=[
            RememberedCamera.of(memory, used_at, is_used=state.settings.camera_memory)
            for memory, used_at in found
        ]
    )


@router.delete(
    "/{name}",
    operation_id="forget_camera",
    status_code=204,
    response_class=Response,
    responses=documented(*READING),
)
async def forget_camera(request: Request, state: State, name: str) -> None:
    """Forget a camera of this key."""
    caller = caller_of(request)
    if not await state.store.call(lambda store: store.forget_camera(caller.name, name)):
        raise CameraNotFound(f"no camera {name!r} is remembered", name)
