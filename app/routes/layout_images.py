"""GET /layout/results/{id}/image: the picture of a recognized page, in its size or smaller."""

from collections.abc import Mapping
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from app.access.callers import require_own_result
from app.http.connection import while_connected
from app.http.problems import documented
from app.http.representations import check_accepted
from app.routes.common_responses import STORE, WORK
from app.schemas.options import MaxPixels
from app.state import AppState, State
from models.errors import ResultNotFound, StoreError

router = APIRouter(tags=["layout"])

JPEG = "image/jpeg"


async def keep_pictures(state: AppState, result_id: str, pictures: Mapping[str, bytes]) -> None:
    """Keep the pictures of a result or of its pages, by the ids of these results.

    Raises
    ------
    StoreError
        When a picture cannot be kept; the result is then deleted, since it names pictures that do not exist.
    """
    try:
        await state.images.keep(pictures)
    except StoreError:
        await state.store.call(lambda store: store.delete_result(result_id))
        raise


@router.get(
    "/layout/results/{id}/image",
    operation_id="layout_result_image",
    response_class=Response,
    responses={
        200: {
            "description": "The page of the result: flat if it was rectified; zones are in its pixels, times its width "
            "over that of the result.",
            "content": {JPEG: {"schema": {"type": "string", "format": "binary"}}},
        },
        **documented("not-found", "not-acceptable", *STORE, *WORK),
    },
)
async def layout_result_image(
    request: Request, state: State, id: str, width: Annotated[MaxPixels, Query()] = None
) -> Response:
    """The picture of a page that was kept with its result (`keep_image`), as JPEG, at most `width` pixels wide.

    It is deleted with its result. `ETag` and `If-None-Match` save sending it again.
    """
    check_accepted(request.headers.get("accept"), JPEG)
    await require_own_result(request, state, id)
    kept = await state.store.call(lambda store: store.result(id))
    described = kept.document.get("result", {}).get("image")
    if described is None:
        of_pages = ". Its pages have results of their own" if kept.pages else ""
        raise ResultNotFound(
            f"there is no picture of result {id!r}; send the page to /layout with keep_image=true{of_pages}",
            id,
        )
    picture = await state.images.picture(id, described["bytes"])
    if width is not None and width < described["width"]:
        seat = state.engine.admit()
        try:
            work = state.engine.submit(state.operations.resize_kept_picture, picture, width)
            picture = await while_connected(request.receive, work)
        finally:
            seat.release()
    # Browsers may keep it, but must ask before they show it again: it may have been deleted.
    return Response(picture, media_type=JPEG, headers={"Cache-Control": "private, no-cache"})
