"""Work on the review queue: claims on pages, and skipping. GET /layout/results lists the queue."""

import logging

from fastapi import APIRouter, Request, Response

from app.access.callers import require_own_result
from app.engine.base import Busy, JobTimedOut, WorkerDied
from app.http.json_bodies import json_request, read_json
from app.http.problems import documented
from app.review.decisions import place_of_stored
from app.routes.common_responses import BODY, READING
from app.schemas.review import Claim, ClaimBody, ClaimRequest
from app.state import AppState, State

router = APIRouter(tags=["review"])
log = logging.getLogger(__name__)


@router.post(
    "/layout/results/{id}/claim",
    operation_id="claim_layout_result",
    responses=documented("conflict", *READING, *BODY),
    openapi_extra=json_request(ClaimRequest, required=False),
)
async def claim_layout_result(request: Request, state: State, id: str) -> Claim:
    """Claim a page of the queue for CLAIM_TTL_S seconds, so that two people do not work on it; or renew the claim.

    `conflict` when somebody else has it, or when it is skipped or verified: `reopen` claims such a page. Feedback needs
    no claim, and ends it. With `recognize` the page is first recognized again if its models have learned since, so that
    nobody corrects what the models know by now.
    """
    caller = await require_own_result(request, state, id)
    body = await read_json(request, ClaimRequest, default=ClaimRequest())
    ttl_s = state.settings.claim_ttl_s
    claim, until = await state.store.call(
        lambda store: store.claim_review(id, caller.name, ttl_s, body.claim, reopen=body.reopen)
    )
    is_again = body.recognize and await _recognize_again(state, id, claim)
    return Claim(result=id, claim=claim, until=until, recognized_again=is_again)


async def _recognize_again(state: AppState, result_id: str, claim: str) -> bool:
    """Replace the result of a claimed page by that of newer models; False if there are none, or no worker is free."""
    result = await state.store.call(lambda store: store.result(result_id))
    try:
        document = await state.review_order.recognize_again(result.document)
    except (Busy, JobTimedOut, WorkerDied) as error:
        log.warning("a claimed page was not recognized again: %s", error.detail)
        return False
    if document is None:
        return False
    place = place_of_stored(document["result"])
    return await state.store.call(lambda store: store.replace_recognition(result_id, claim, document, place))


@router.post(
    "/layout/results/{id}/release",
    operation_id="release_layout_result",
    status_code=204,
    response_class=Response,
    responses=documented("conflict", *READING, *BODY),
    openapi_extra=json_request(ClaimBody, required=False),
)
async def release_layout_result(request: Request, state: State, id: str) -> None:
    """Give a claimed page back to the queue. `conflict` when the claim has ended, or is not the one on the page."""
    await require_own_result(request, state, id)
    body = await read_json(request, ClaimBody, default=ClaimBody())
    await state.store.call(lambda store: store.release_review(id, body.claim))


@router.post(
    "/layout/results/{id}/skip",
    operation_id="skip_layout_result",
    status_code=204,
    response_class=Response,
    responses=documented("conflict", *READING, *BODY),
    openapi_extra=json_request(ClaimBody, required=False),
)
async def skip_layout_result(request: Request, state: State, id: str) -> None:
    """Take a page out of the open ones without feedback; feedback on it changes that.

    `conflict` when somebody else has it, or when the claim that is sent has ended.
    """
    await require_own_result(request, state, id)
    body = await read_json(request, ClaimBody, default=ClaimBody())
    await state.store.call(lambda store: store.release_review(id, body.claim, skip=True))
