"""GET /audit: who changed what, and when."""

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from app.http.paging import LINK, OF_LINK, link_next
from app.http.problems import documented
from app.routes.common_responses import STORE
from app.schemas.layout_models import NameInBody
from app.schemas.options import Absent, Written
from app.schemas.review import AuditEntry, ChangeList
from app.state import State

router = APIRouter(tags=["review"])

MOST_LISTED = 200


@router.get(
    "/audit",
    operation_id="audit",
    response_class=Response,
    responses={
        200: {"description": "Changes, newest first.", "model": ChangeList, "headers": LINK},
        **documented("forbidden", "invalid-option", *STORE),
    },
)
async def audit(
    request: Request,
    state: State,
    model: Annotated[
        NameInBody | Absent,
        Query(description="Only changes of this model."),
    ] = None,
    limit: Annotated[int, Query(ge=1, le=MOST_LISTED)] = 50,
    cursor: Annotated[
        Annotated[str, Written("^[0-9A-HJKMNP-TV-Z]{26}$", OF_LINK)] | Absent,
        Query(description="From the header `Link`."),
    ] = None,
) -> Response:
    """List who changed models or deleted data, newest first. The newest 100 000 entries are kept."""
    found = await state.store.call(lambda store: store.changes(limit + 1, model=model, before=cursor))
    entries = [
        AuditEntry(
            id=entry.id,
            time=entry.created_at,
            who=entry.who,
            action=entry.action,
            model=entry.model,
            detail=entry.detail,
        )
        for entry in found[:limit]
    ]
    body = ChangeList(entries=entries).model_dump_json()
    response = Response(body, media_type="application/json")
    if len(found) > limit:
        link_next(request, state, response, found[limit - 1].id)
    return response
