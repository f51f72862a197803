"""GET and DELETE of /layout/results/{id}: a stored result again, as JSON or as HTML."""

from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response

from app.callers import require_own_result
from app.connection import while_connected
from app.problems import documented
from app.representations import choose_described_format, content_disposition, layout_headers
from app.routes.common_responses import STORE, WORK
from app.routes.json_answers import answer_json
from app.routes.state import AppState, State
from app.schemas.layout import DocumentResult, LayoutResult, document_of, result_of
from app.schemas.layout_results import RESULT_MEDIA_TYPES, ResultFormat
from models.errors import ModelNotFound, ResultNotFound
from models.records import StoredResult
from models.repository import Store
from services.contract.html import HtmlElement, KeptPage

router = APIRouter(tags=["layout"])


@router.get(
    "/layout/results/{id}",
    operation_id="layout_result",
    response_class=Response,
    responses={
        200: {
            "description": "The result again.",
            "model": LayoutResult | DocumentResult,
            "content": {"text/html": {"schema": {"type": "string"}}},
        },
        **documented("not-found", "not-acceptable", *STORE, *WORK),
    },
)
async def layout_result(
    request: Request,
    state: State,
    id: str,
    format: Annotated[ResultFormat | None, Query(description="Or by `Accept`.")] = None,
) -> Response:
    """A stored result as JSON, or as an HTML file with the pictures that were kept (`keep_image`).

    It is kept for RESULT_TTL_S seconds, or until MAX_RESULTS newer results exist. HTML has the labels and texts as
    feedback has corrected them, in elements by the present settings of the class. For another format, send the page
    to POST /layout again.
    """
    chosen = choose_described_format(format, request.headers.get("accept"), RESULT_MEDIA_TYPES)
    await require_own_result(request, state, id)
    kept = await state.store.call(lambda store: store.result(id))
    if chosen == "html":
        return await _answer_html(request, state, kept)
    return await answer_json(partial(_shown, kept), headers={"Vary": "Accept"})


def _shown(kept: StoredResult) -> LayoutResult | DocumentResult:
    if "pages" not in kept.document:
        return result_of(kept.document["result"], kept.id)
    pages = [result_of(page.document["result"], page.id) for page in kept.pages]
    return document_of(kept.document["document"], kept.id, pages)


@router.delete(
    "/layout/results/{id}",
    operation_id="delete_layout_result",
    status_code=204,
    responses=documented("not-found", *STORE),
)
async def delete_layout_result(request: Request, state: State, id: str) -> None:
    """Delete a stored result with its picture, the results of its pages, and its unknown page.

    What models learned from feedback on it remains; DELETE /layout/results/{id}/feedback takes that back, before or
    after.
    """
    await require_own_result(request, state, id)
    await state.images.forget(await state.store.call(lambda store: store.delete_result(id)))


async def _answer_html(request: Request, state: AppState, kept: StoredResult) -> Response:
    results = kept.pages if "pages" in kept.document else (kept,)
    pages = [await _kept_page(state, each) for each in results]
    seat = state.engine.admit()
    try:
        work = state.engine.submit(state.operations.render_kept_pages, pages, "")
        body = await while_connected(request.receive, work)
    finally:
        seat.release()
    headers = layout_headers(kept.document["document" if "pages" in kept.document else "result"])
    headers |= content_disposition(kept.id, "", RESULT_MEDIA_TYPES["html"])
    return Response(body, media_type=RESULT_MEDIA_TYPES["html"], headers=headers)


async def _kept_page(state: AppState, kept: StoredResult) -> KeptPage:
    result = kept.document["result"]
    elements = await state.store.call(lambda store: _elements_of(store, result))
    picture = b""
    if result.get("image") is not None:
        try:
            picture = await state.images.picture(kept.id, result["image"]["bytes"])
        except ResultNotFound:  # it gave way to newer pictures
            picture = b""
    return KeptPage(result, picture, elements)


def _elements_of(store: Store, result: Mapping[str, Any]) -> dict[str, HtmlElement]:
    """The elements that settings name: of the document's class, then of the model that gave the labels."""
    of_labels = result["class"] or next(iter(result["classes"]), None)
    elements: dict[str, HtmlElement] = {}
    for name in (result.get("document_class"), None if of_labels is None else of_labels["name"]):
        if name is None:
            continue
        try:
            elements |= store.settings(name).elements
        except ModelNotFound:  # deleted since
            continue
    return elements
