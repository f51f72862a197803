"""Kept photos: their pages as JSON, the photos, later answers without sending them again, and files of several."""

from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response

from app.access.callers import Caller, caller_of
from app.engine.base import TimeLimit
from app.http.connection import while_connected
from app.http.json_answers import JSON, answer_json
from app.http.json_bodies import json_request, read_json
from app.http.ocr_languages import chosen_language
from app.http.problems import documented
from app.http.representations import (
    check_accepted,
    choose_described_format,
    content_disposition,
    file_stem,
    image_headers,
)
from app.routes.common_responses import BODY, STORE, WORK
from app.routes.page_answers import BINARY, RECTIFY_HEADERS, flat_pages
from app.schemas.kept_pages import (
    FILE_FORMATS,
    PICTURE_FORMATS,
    BindRequest,
    Picture,
    PictureFormat,
    RenderRequest,
)
from app.schemas.options import MaxPixels
from app.state import AppState, State
from models.errors import KeptPageNotFound, ResultNotFound, StoreError
from models.records import StoredPage
from services.contract.answers.mosaic import MosaicResult
from services.contract.answers.rectify import RectifyResult
from services.contract.images import MEDIA_TYPES, Encoding, PageReply, SeveralFormat
from services.contract.kept_pages import KeptPage, KeptPageJson, PageReading, PageWish, RenderedPage

router = APIRouter(prefix="/pages", tags=["pages"])

JPEG = "image/jpeg"


async def keep_photos(state: AppState, caller: Caller, reply: PageReply, names: Sequence[str | None]) -> None:
    """Keep the pages of a reply of /rectify or /mosaic, and write their ids (`page_id`) into its answer.

    `names` are the file names of the uploads; where there are fewer than pages, the first one's is that of all.

    Raises
    ------
    StoreError
        When a photo cannot be kept; then none is.
    """
    described: Sequence[RectifyResult | MosaicResult]
    described = [reply.answer] if isinstance(reply.answer, MosaicResult) else flat_pages(reply)
    kept = [(page, each) for page, each in zip(described, reply.kept, strict=False) if each is not None]
    of_all = len(names) != len(described)
    documents: list[KeptPageJson] = [
        {**each.document, "bytes": len(each.bundle), "name": names[0 if of_all else number]}
        for number, (_, each) in enumerate(kept)
    ]
    if not documents:
        return
    ids = await state.store.keep_pages(documents, caller.name)
    try:
        await state.photos.keep({id: each.bundle for id, (_, each) in zip(ids, kept, strict=True)})
    except StoreError:
        for id in ids:
            await state.store.call(lambda store, id=id: store.delete_kept_page(id))  # type: ignore[misc]
        raise
    for id, (page, _) in zip(ids, kept, strict=True):
        page.page_id = id


async def own_page(request: Request, state: AppState, page_id: str) -> StoredPage:
    """A kept page of the caller. Raises `KeptPageNotFound`, also where another key has it."""
    if "/" in page_id:
        raise KeptPageNotFound(
            f"{page_id!r} is no id of a kept page: send the id alone, without its path", page_id
        )
    page = await state.store.call(lambda store: store.kept_page(page_id))
    if not caller_of(request).sees(page.owner):
        raise KeptPageNotFound(f"there is no kept page {page_id!r}, or no longer", page_id)
    return page


async def kept_page(state: AppState, page: StoredPage) -> KeptPage:
    """The page as a worker takes it. Raises `KeptPageNotFound` when its photo is no longer there."""
    try:
        bundle = await state.photos.picture(page.id, page.document["bytes"])
    except ResultNotFound as error:
        raise KeptPageNotFound(
            f"the photo of page {page.id!r} is not there: it gave way to newer ones (MAX_KEPT_PHOTOS_BYTES), or the "
            "database was restored without its blobs; send it again",
            page.id,
        ) from error
    return KeptPage(bundle, page.document)


@router.get(
    "/{id}", operation_id="kept_page", responses=documented("not-found", *STORE), response_model=RectifyResult
)
async def show_page(request: Request, state: State, id: str) -> Response:
    """The description of a kept page at full size, by what was said of it last, without text (see its render)."""
    page = await own_page(request, state, id)
    return await answer_json(partial(described, page))


def described(page: StoredPage) -> RectifyResult:
    """The description of a kept page."""
    answer = page.document.get("shown", page.document["answer"])
    return RectifyResult.model_validate({**answer, "page_id": page.id, "timings_ms": {}, "text": None})


@router.get(
    "/{id}/photo",
    operation_id="kept_photo",
    response_class=Response,
    responses={
        200: {"description": "The photo, turned as its EXIF says.", "content": {JPEG: BINARY}},
        **documented("not-found", "not-acceptable", *STORE, *WORK),
    },
)
async def show_photo(
    request: Request, state: State, id: str, width: Annotated[MaxPixels, Query()] = None
) -> Response:
    """The photo of a kept page as JPEG without its metadata, at most `width` pixels wide."""
    check_accepted(request.headers.get("accept"), JPEG)
    kept = await kept_page(state, await own_page(request, state, id))
    work = state.engine.submit(state.operations.show_kept_photo, kept.bundle, width)
    photo = await while_connected(request.receive, work)
    return Response(photo, media_type=JPEG, headers={"Cache-Control": "private, no-cache"})


@router.post(
    "/{id}/render",
    operation_id="render_kept_page",
    response_class=Response,
    responses={
        200: {
            "description": "The flat page, or its description as JSON.",
            "model": RectifyResult,
            "content": {MEDIA_TYPES[name]: BINARY for name in PICTURE_FORMATS if name != "json"},
            "headers": RECTIFY_HEADERS,
        },
        **documented("not-found", "not-acceptable", "invalid-option", *BODY, *STORE, *WORK),
    },
    openapi_extra=json_request(RenderRequest, required=False),
)
async def render_page(request: Request, state: State, id: str) -> Response:
    """Answer again about a kept page: other corners, turn, margin, light, look, part or format, without its photo.

    All but corners is drawn from what was kept; between other corners the page is analysed again. What is said counts
    from then on, also for files of several pages. With text=true the page is read, and its text is kept.
    """
    asked = await read_json(request, RenderRequest, default=RenderRequest())
    page = await own_page(request, state, id)
    own: PictureFormat = "jpeg" if page.document["format"] == "heic" else page.document["format"]
    formats = {name: MEDIA_TYPES[name] for name in (own, *PICTURE_FORMATS)}
    chosen = choose_described_format(asked.format, request.headers.get("accept"), formats)
    encoding = encoding_of(
        asked,
        page,
        chosen,
        embed=asked.embed or asked.embed_format is not None,
        embed_format=asked.embed_format,
    )
    kept = await kept_page(state, page)
    reading = reading_of(asked, state, needed=asked.text)
    work = state.engine.submit(state.operations.render_kept_page, kept, asked.wish, encoding, reading)
    reply, changed = await while_connected(request.receive, work)
    (answer,) = flat_pages(reply)
    answer.page_id = id
    if asked.wish != PageWish():
        await keep_change(state, page, changed)
    elif reading is not None and reading.is_wanted:  # only read: what a person has said meanwhile stays
        now = await own_page(request, state, id)
        read: KeptPageJson = {**now.document, "text": changed.document["text"]}
        await state.store.call(lambda store: store.change_kept_page(id, read))
    if reply.media_type == JSON:
        return await answer_json(lambda: answer, headers={"Vary": "Accept"})
    return file_answer(reply, page)


async def keep_change(state: AppState, page: StoredPage, changed: RenderedPage) -> None:
    """Keep what a person has said of a page, and what is known of it since then."""
    document: KeptPageJson = {
        **changed.document,
        "bytes": len(changed.bundle) or page.document["bytes"],
        "name": page.document["name"],
    }
    if changed.bundle:
        await state.photos.forget([page.id])
        await state.photos.keep({page.id: changed.bundle})
    await state.store.call(lambda store: store.change_kept_page(page.id, document))


@router.post(
    "/bind",
    operation_id="bind_kept_pages",
    response_class=Response,
    responses={
        200: {
            "description": "The file of all pages.",
            "content": {MEDIA_TYPES[name]: BINARY for name in FILE_FORMATS},
            "headers": RECTIFY_HEADERS,
        },
        **documented("not-found", "invalid-option", *BODY, *STORE, *WORK),
    },
    openapi_extra=json_request(BindRequest),
)
async def bind_pages(request: Request, state: State) -> Response:
    """One file of kept pages in the order of their ids, each as it was last answered.

    With text=true a PDF can be searched; the formats hocr, alto, txt and markdown are the text itself. What was read
    of a page once (by /rectify or its render with text=true) is not read again.
    """
    asked = await read_json(request, BindRequest)
    pages = [await own_page(request, state, id) for id in asked.pages]
    encoding = encoding_of(asked, pages[0], asked.format, asked.format)
    kept = [await kept_page(state, page) for page in pages]
    limit = TimeLimit(state.settings.document_timeout_s, "DOCUMENT_TIMEOUT_S")
    reading = reading_of(asked, state, needed=asked.text or encoding.needs_text)
    work = state.engine.submit(state.operations.bind_kept_pages, kept, encoding, reading, time_limit=limit)
    reply = await while_connected(request.receive, work)
    return file_answer(reply, pages[0])


@router.delete(
    "/{id}",
    operation_id="delete_kept_page",
    status_code=204,
    response_class=Response,
    responses=documented("not-found", *STORE),
)
async def delete_page(request: Request, state: State, id: str) -> None:
    """Delete a kept page with its photo."""
    await own_page(request, state, id)
    await state.store.call(lambda store: store.delete_kept_page(id))
    await state.photos.forget([id])


def encoding_of(
    asked: Picture,
    page: StoredPage,
    single: PictureFormat | SeveralFormat,
    several: SeveralFormat | None = None,
    **more: Any,
) -> Encoding:
    """The encoding of an answer about `page`, or about several of which it is the first."""
    name = page.document["name"]
    return Encoding(
        format=single,
        quality=asked.quality,
        pages_format=several,
        max_width=asked.max_width,
        max_height=asked.max_height,
        pdf_version=asked.pdf_version,
        title=asked.title or file_stem(name),
        **more,
    )


def reading_of(asked: Picture, state: AppState, *, needed: bool) -> PageReading | None:
    """How the pages are read; None where their text is not needed, and no language is asked for.

    Raises
    ------
    InvalidOption
        When OCR_LANGUAGES does not have the language.
    """
    language = chosen_language(asked.language, state.settings)
    return PageReading(language, needed) if needed or asked.language else None


def file_answer(reply: PageReply, page: StoredPage) -> Response:
    """The response with the file of `reply`."""
    headers = image_headers(reply.answer) | {"Vary": "Accept"}
    headers |= content_disposition(page.document["name"], "-flat", reply.media_type)
    return Response(reply.body, media_type=reply.media_type, headers=headers)
