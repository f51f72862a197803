"""POST /layout: a page or its zones -> document class and labels."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Form, Query, Request, Response

from app.access.callers import caller_of
from app.http.json_answers import answer_json
from app.http.known_options import known_parts, with_format
from app.http.ocr_languages import chosen_language
from app.http.problems import documented
from app.http.representations import (
    choose_described_format,
    content_disposition,
    file_name,
    layout_headers,
    stack_headers,
)
from app.learning.labelled_pages import MissingPart, layout_settings, zones_upload
from app.review.decisions import tolerated_errors_of
from app.routes.common_responses import FILE_NAME, FORM, IMAGE, STORE, WORK
from app.routes.document_uploads import check_not_empty, document_limits, document_time_limit
from app.routes.layout_images import keep_pictures
from app.routes.long_work import ACCEPTED, PREFER, answer_now_or_later
from app.routes.sent_uploads import UploadFormRoute
from app.schemas.layout import LayoutForm, parse_names, stored_form, stored_whole
from app.schemas.options import FORMAT, Absent, CallbackUrl
from app.settings import Settings
from app.state import AppState, State
from services.contract.answers.layout import DocumentResult, LayoutResult, StackResult
from services.contract.layout import (
    MEDIA_TYPES,
    DocumentPage,
    DocumentReply,
    LayoutFormat,
    LayoutOptions,
    LayoutReply,
    LayoutSettings,
    StackReply,
)
from services.errors import InvalidOption, TooLarge
from services.progress import ProgressSink

router = APIRouter(tags=["layout"], route_class=UploadFormRoute)

SUFFIXES: dict[LayoutFormat, str] = {"pagexml": ".page", "alto": ".alto", "png": "-labelled", "html": ""}
"""What the file names of results add to that of the upload."""
ONE_BY_ONE = "the documents of a stack are answered as json; each is a result of its own and has all formats."
UNNAMED = "page"
"""Name in PAGE-XML, ALTO and HTML of an image without one."""
_STRING = {"schema": {"type": "string"}}
_BINARY = {"schema": {"type": "string", "format": "binary"}}
OTHER_CONTENT = {
    "application/zip": _BINARY,
    "application/xml": _STRING,
    "image/png": _BINARY,
    "text/html": _STRING,
}
"""Answers that are not JSON, for the OpenAPI document."""
HEADERS = {
    "Document-Class": {"description": "Name of the class; absent when `class` is null.", **_STRING},
    "Document-Result": {"description": "Path of the stored result as JSON.", **_STRING},
    "Document-Scale": {
        "description": "With png: horizontal and vertical scale of the page in the picture, separated by a comma. The "
        "page's point (x, y) is at (x scale_x + left, y scale_y + top).",
        **_STRING,
    },
    "Document-Offset": {
        "description": "With png: left and top edge of the page in the picture, pixels, separated by a comma.",
        **_STRING,
    },
    "Document-Warnings": {"description": "Codes, separated by commas.", **_STRING},
    "Server-Timing": {"description": "Milliseconds of each stage.", **_STRING},
    **FILE_NAME,
}


@router.post(
    "/layout",
    operation_id="layout",
    response_class=Response,
    responses={
        200: {
            "description": "Class and labels, as JSON, as PAGE-XML or ALTO (application/xml; several pages give an "
            "archive of such files), as HTML, or drawn on the page.",
            "model": LayoutResult | DocumentResult | StackResult,
            "content": OTHER_CONTENT,
            "headers": HEADERS,
        },
        **ACCEPTED,
        **documented(
            "not-found",
            "not-acceptable",
            "conflict",
            "invalid-model",
            "no-text",
            *FORM,
            *IMAGE,
            *STORE,
            *WORK,
        ),
    },
    openapi_extra=PREFER,
    dependencies=[known_parts(LayoutForm)],
    form_limits={"max_fields": 50},
)
async def layout(
    request: Request,
    state: State,
    form: Annotated[LayoutForm, Form(media_type="multipart/form-data")],
    format: Annotated[LayoutFormat | Absent, FORMAT, Query(description="As the field of the form.")] = None,
    callback_url: Annotated[CallbackUrl, Query()] = None,
) -> Response:
    """Recognize the class of a document and the logical label of each of its zones.

    Send the page as `image`, or its zones as `zones` or `zones_file`, or the image and its zones. Send the pages of a
    document as several parts `image` in their order, or as a TIFF file or PDF. The response format follows `format`,
    or `Accept` (application/xml: PAGE-XML), else it is JSON. The result is stored for a limited time under its id.
    Without any model, zones have no labels and `class` is null. `class` is also null when the page more probably
    belongs to none of the classes; its zones then have the labels of the best model.

    The response for several pages is a `DocumentResult`. A model whose settings say that it `continues` a class
    describes later pages of that class's documents. The chosen class is the one whose models together fit all pages
    best.

    With `split=true` the pages are a stack, and the answer is a `StackResult`: documents in their order, each stored as
    a result of its own. Samples of first and of later pages of a class tell where its documents begin.
    """
    form = with_format(form, format)
    settings, caller = state.settings, caller_of(request)
    check_parts(form, settings)
    held: Mapping[LayoutFormat, str] = {"json": MEDIA_TYPES["json"]} if form.split else MEDIA_TYPES
    if form.format is not None and form.format not in held:
        raise InvalidOption(f"format: {ONE_BY_ONE}", "format")
    chosen = choose_described_format(form.format, request.headers.get("accept"), held)
    images = form.image or []
    check_not_empty(images)
    names = [file_name(image.filename) for image in images]
    first_name = names[0] if names else None
    language = chosen_language(form.language, settings)
    models = await state.store.ready_models(None if form.models is None else parse_names(form.models))
    zones = zones_upload(form.zones, "zones", settings.max_zones_bytes)
    zones_file = zones_upload(form.zones_file, "zones_file", settings.max_zones_file_bytes)
    time_limit = await document_time_limit(images, settings, split=form.split)
    keeps_image = bool(images) and (settings.keep_images if form.keep_image is None else form.keep_image)

    async def work(progress: ProgressSink | None) -> Response:
        reply = await state.engine.submit(
            state.operations.recognize_layout,
            images,
            zones,
            zones_file,
            models,
            LayoutOptions(
                rectify=form.rectify,
                ocr=form.ocr == "auto",
                format=chosen,
                explain=form.explain,
                words=form.words,
                image_name=first_name or UNNAMED,
                image_names=tuple(name or UNNAMED for name in names),
                page=form.page,
                format_named=form.format is not None,
                keep_image_bytes=settings.max_kept_image_bytes if keeps_image else 0,
                language=language,
                split=form.split,
            ),
            _limits(settings, split=form.split),
            time_limit=time_limit,
            progress=progress,
        )
        request.state.seat.release()
        for page in _pages_of(reply):
            await _decide(state, page.answer)
        if isinstance(reply, StackReply):
            return await _answer_stack(state, reply, names, caller.name)
        if isinstance(reply, DocumentReply):
            return await _answer_document(state, reply, chosen, names, caller.name)
        result = reply.answer
        result.file_name = first_name
        stored = await asyncio.to_thread(stored_form, result)
        result.id = await state.store.keep_result({"result": stored, "page": reply.page}, caller.name)
        await keep_pictures(state, result.id, {result.id: reply.picture})
        headers = layout_headers(result, reply.drawn)
        headers["Document-Result"] = f"/layout/results/{result.id}"
        if chosen != "json":
            headers |= content_disposition(first_name, SUFFIXES[chosen], reply.media_type)
            return Response(reply.body, media_type=reply.media_type, headers=headers)
        return await answer_json(lambda: result, headers=headers)

    return await answer_now_or_later(request, state, work)


def _pages_of(reply: LayoutReply | DocumentReply | StackReply) -> Sequence[LayoutReply | DocumentPage]:
    if isinstance(reply, StackReply):
        return [page for document in reply.documents for page in document.pages]
    return reply.pages if isinstance(reply, DocumentReply) else (reply,)


async def _answer_stack(
    state: AppState, reply: StackReply, names: Sequence[str | None], owner: str | None
) -> Response:
    """Store and answer the documents of a stack; `names` are those of the images."""
    documents = [await _keep_document(state, document, names, owner) for document in reply.documents]
    return await answer_json(lambda: StackResult(documents=documents), headers=stack_headers(documents))


async def _answer_document(
    state: AppState,
    reply: DocumentReply,
    chosen: LayoutFormat,
    names: Sequence[str | None],
    owner: str | None,
) -> Response:
    """Store and answer a document; `names` are those of the images."""
    whole = await _keep_document(state, reply, names, owner)
    headers = layout_headers(whole)
    headers["Document-Result"] = f"/layout/results/{whole.id}"
    if chosen != "json":
        headers |= content_disposition(names[0], SUFFIXES[chosen], reply.media_type)
        return Response(reply.body, media_type=reply.media_type, headers=headers)
    return await answer_json(lambda: whole, headers=headers)


async def _keep_document(
    state: AppState, reply: DocumentReply, names: Sequence[str | None], owner: str | None
) -> DocumentResult:
    """The answer about a document that is now stored, with its id and its pages."""
    whole = reply.answer
    whole.file_name = names[reply.pages[0].upload]
    for page in reply.pages:
        page.answer.file_name = names[page.upload]
    document = stored_whole(whole)
    pages = await asyncio.to_thread(lambda: [stored_form(page.answer) for page in reply.pages])
    whole.id, page_ids = await state.store.keep_document(
        {"document": document},
        [{"result": stored, "page": page.page} for stored, page in zip(pages, reply.pages, strict=True)],
        owner,
    )
    for page, page_id in zip(reply.pages, page_ids, strict=True):
        page.answer.id = page_id
        whole.pages.append(page.answer)
    pictures = {page_id: page.picture for page, page_id in zip(reply.pages, page_ids, strict=True)}
    await keep_pictures(state, whole.id, pictures)
    return whole


async def _decide(state: AppState, result: LayoutResult) -> None:
    """Give a page that was compared with models the decision on it."""
    if not result.classes:
        return
    name = result.class_.name if result.class_ else "*"
    tolerated = tolerated_errors_of(name, state.settings.tolerated_errors)
    result.decision = await state.store.decision(result, tolerated)


def _limits(settings: Settings, *, split: bool) -> LayoutSettings:
    """Limits of /layout: one file may be a whole document, so it may be as large as the whole body."""
    return replace(layout_settings(settings), document=document_limits(settings, split=split))


def check_parts(form: LayoutForm, settings: Settings) -> None:
    """Raise if the parts of the form do not fit together.

    Raises
    ------
    MissingPart, InvalidOption, TooLarge
    """
    has_zones = form.zones is not None or form.zones_file is not None
    images = form.image or []
    if not images and not has_zones:
        raise MissingPart(
            "image: send the page as a file part of multipart/form-data, or its zones as `zones` or `zones_file`.",
            "image",
        )
    if form.zones is not None and form.zones_file is not None:
        raise InvalidOption("zones_file: send either zones or zones_file, not both.", "zones_file")
    limits = document_limits(settings, split=form.split)
    if len(images) > limits.max_pages:
        setting = "MAX_STACK_PAGES" if form.split else "MAX_PAGES"
        raise TooLarge(
            f"image: a {limits.of} may have {limits.max_pages} pages ({setting}); {len(images)} images were sent.",
            "image",
        )
    if form.split and has_zones:
        raise InvalidOption("split: zones describe one page. Send images, a TIFF file or a PDF.", "split")
    if form.split and form.page is not None:
        raise InvalidOption("split: `page` names one page. Send one of the two.", "split")
    if has_zones and (len(images) > 1 or form.page is not None):
        field = "image" if len(images) > 1 else "page"
        raise InvalidOption(f"{field}: zones describe one page. Send them with one image.", field)
    if form.keep_image and not images:
        raise InvalidOption("keep_image: there is no image to keep. Send the page as `image`.", "keep_image")
    if form.rectify and has_zones:
        raise InvalidOption(
            "rectify: zones are in pixels of the image before rectification. Send the image without zones.",
            "rectify",
        )
