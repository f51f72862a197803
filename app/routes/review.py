"""The review queue: recognized pages that a person should look at, claims on them, and skipping."""

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response

from app.callers import caller_of, require_own_result
from app.problems import documented
from app.routes.common_responses import BODY, READING, STORE
from app.routes.json_bodies import json_request, read_json
from app.routes.paging import LINK, link_next
from app.routes.state import State
from app.schemas.options import Absent
from app.schemas.review import Claim, ClaimBody, Queue, QueueEntry
from models.records import Review
from models.repository import cursor_of

router = APIRouter(tags=["review"])

MOST_LISTED = 200
CURSOR_PATTERN = r"^[0-9]{1,9}(\.[0-9]{1,20})?(e-[0-9]{1,3})?_[0-9A-HJKMNP-TV-Z]{26}$"


@router.get(
    "/layout/queue",
    operation_id="layout_queue",
    response_class=Response,
    responses={
        200: {"description": "A part of the queue.", "model": Queue, "headers": LINK},
        **documented("invalid-option", *STORE),
    },
)
async def layout_queue(
    request: Request,
    state: State,
    state_: Annotated[
        Literal["open", "confirmed", "corrected", "skipped", "all"],
        Query(
            alias="state",
            description="open: nobody has given feedback. corrected: feedback found something wrong.",
        ),
    ] = "open",
    order: Annotated[
        Literal["gain", "confidence", "newest"],
        Query(description="gain: what is expected to teach most first. confidence: the least sure first."),
    ] = "gain",
    limit: Annotated[int, Query(ge=1, le=MOST_LISTED)] = 50,
    cursor: Annotated[
        str | Absent, Query(pattern=CURSOR_PATTERN, description="From the header `Link` of the part before.")
    ] = None,
) -> Response:
    """List recognized pages, those first that need a person most.

    Pages that another person has claimed keep their place in the list. With API keys, the pages are those of the
    caller's key.
    """
    caller = caller_of(request)
    found = await state.store.call(
        lambda store: store.reviews(
            limit + 1,
            state=None if state_ == "all" else state_,
            order=order,
            after=cursor,
            owner=None if caller.sees_all else caller.name,
        )
    )
    body = Queue(results=[_entry(review) for review in found[:limit]]).model_dump_json(by_alias=True)
    response = Response(body, media_type="application/json")
    if len(found) > limit:
        link_next(request, state, response, cursor_of(found[limit - 1], order))
    return response


@router.post(
    "/layout/results/{id}/claim",
    operation_id="claim_layout_result",
    responses=documented("conflict", *READING, *BODY),
    openapi_extra=json_request(ClaimBody, required=False),
)
async def claim_layout_result(request: Request, state: State, id: str) -> Claim:
    """Claim a page of the queue for CLAIM_TTL_S seconds, so that two people do not work on it; or renew the claim.

    `conflict` when somebody else has it. Feedback needs no claim.
    """
    caller = await require_own_result(request, state, id)
    body = await read_json(request, ClaimBody, default=ClaimBody())
    ttl_s = state.settings.claim_ttl_s
    claim, until = await state.store.call(
        lambda store: store.claim_review(id, caller.name, ttl_s, body.claim)
    )
    return Claim(result=id, claim=claim, until=until)


@router.post(
    "/layout/results/{id}/release",
    operation_id="release_layout_result",
    status_code=204,
    responses=documented("conflict", *READING, *BODY),
    openapi_extra=json_request(ClaimBody, required=False),
)
async def release_layout_result(request: Request, state: State, id: str) -> None:
    """Give a claimed page back to the queue."""
    await require_own_result(request, state, id)
    body = await read_json(request, ClaimBody, default=ClaimBody())
    await state.store.call(lambda store: store.release_review(id, body.claim))


@router.post(
    "/layout/results/{id}/skip",
    operation_id="skip_layout_result",
    status_code=204,
    responses=documented("conflict", *READING, *BODY),
    openapi_extra=json_request(ClaimBody, required=False),
)
async def skip_layout_result(request: Request, state: State, id: str) -> None:
    """Take a page out of the open ones without feedback; feedback on it changes that."""
    await require_own_result(request, state, id)
    body = await read_json(request, ClaimBody, default=ClaimBody())
    await state.store.call(lambda store: store.release_review(id, body.claim, skip=True))


def _entry(review: Review) -> QueueEntry:
    return QueueEntry(
        id=review.id,
        state=review.state,
        **{"class": review.class_name},
        zones=review.zones,
        confidence=round(review.confidence, 4),
        gain=round(review.gain, 4),
        decision="accept" if review.decision == "accept" else "review",
        has_image=review.has_image,
        created=review.created_at,
        claimed_by=review.claimed_by,
        claimed_until=review.claimed_until,
    )
