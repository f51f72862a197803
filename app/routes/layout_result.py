"""GET and DELETE of /layout/results/{id}: a stored result again, in any format, as feedback has corrected it."""

import asyncio
from collections import Counter
from collections.abc import Sequence
from functools import partial
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from app.access.callers import require_own_result
from app.http.connection import while_connected
from app.http.json_answers import answer_json
from app.http.problems import documented
from app.http.representations import choose_described_format, content_disposition, layout_headers
from app.learning.labelled_pages import layout_settings
from app.routes.common_responses import STORE, WORK
from app.routes.layout import HEADERS, OTHER_CONTENT, SUFFIXES
from app.schemas.layout import document_of, result_of
from app.state import AppState, State
from models.errors import ModelNotFound, ResultNotFound
from models.records import StoredResult
from models.repository import Store
from services.contract.answers.layout import DocumentResult, LayoutResult
from services.contract.html import HtmlElement
from services.contract.layout import MEDIA_TYPES, KeptResult, LayoutFormat
from services.contract.result_json import ResultJson

router = APIRouter(tags=["layout"])


@router.get(
    "/layout/results/{id}",
    operation_id="layout_result",
    response_class=Response,
    responses={
        200: {
            "description": "The result again.",
            "model": LayoutResult | DocumentResult,
            "content": OTHER_CONTENT,
            "headers": HEADERS,
        },
        **documented("not-found", "not-acceptable", "invalid-option", *STORE, *WORK),
    },
)
async def layout_result(
    request: Request,
    state: State,
    id: str,
    format: Annotated[LayoutFormat | None, Query(description="Or by `Accept`.")] = None,
) -> Response:
    """A stored result as feedback has corrected it, in the formats of POST /layout.

    It is kept for RESULT_TTL_S seconds, or until MAX_RESULTS newer results exist. HTML and pictures show the picture of
    the page if it was kept (`keep_image`). HTML has elements by the present settings of the class. XML has words if
    they were asked for (`words`).
    """
    chosen = choose_described_format(format, request.headers.get("accept"), MEDIA_TYPES)
    await require_own_result(request, state, id)
    kept = await state.store.call(lambda store: store.result(id))
    if chosen != "json":
        return await _answer_file(request, state, kept, chosen)
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
    response_class=Response,
    responses=documented("not-found", *STORE),
)
async def delete_layout_result(request: Request, state: State, id: str) -> None:
    """Delete a stored result with its picture, the results of its pages, and its unknown page.

    What models learned from feedback on it remains; DELETE /layout/results/{id}/feedback takes that back, before or
    after.
    """
    await require_own_result(request, state, id)
    await state.images.forget(await state.store.call(lambda store: store.delete_result(id)))


async def _answer_file(
    request: Request, state: AppState, kept: StoredResult, chosen: LayoutFormat
) -> Response:
    results = kept.pages if "pages" in kept.document else (kept,)
    names = _image_names(results)
    pages = [await _kept_result(state, each, chosen, name) for each, name in zip(results, names, strict=True)]
    seat = state.engine.admit()
    try:
        settings = layout_settings(state.settings)
        work = state.engine.submit(state.operations.render_results, pages, chosen, settings)
        file = await while_connected(request.receive, work)
    finally:
        seat.release()
    shown = await asyncio.to_thread(_shown, kept)
    headers = layout_headers(shown, file.drawn)
    headers |= content_disposition(kept.id, SUFFIXES.get(chosen, ""), file.media_type)
    return Response(file.body, media_type=file.media_type, headers=headers)


def _image_names(results: Sequence[StoredResult]) -> list[str]:
    """Names of the images in whose pixels the pages are: those of the uploads, else the ids of the results.

    Pages of one file, and flat pages, are not the uploaded image.
    """
    documents = [each.document["result"] for each in results]
    uploads = Counter(document.get("file_name") for document in documents)
    return [
        name if name and uploads[name] == 1 and document.get("page") is None else each.id
        for each, document in zip(results, documents, strict=True)
        for name in [document.get("file_name")]
    ]


async def _kept_result(
    state: AppState, kept: StoredResult, chosen: LayoutFormat, image_name: str
) -> KeptResult:
    result = kept.document["result"]
    elements = await state.store.call(lambda store: _elements_of(store, result))
    picture = b""
    image = result.get("image")
    if chosen in ("html", "png") and image is not None:
        try:
            picture = await state.images.picture(kept.id, image["bytes"])
        except ResultNotFound:  # it gave way to newer pictures
            picture = b""
    return KeptResult(result, kept.document["page"], image_name, picture, elements)


def _elements_of(store: Store, result: ResultJson) -> dict[str, HtmlElement]:
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
