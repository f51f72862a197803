"""POST /rectify/image, /mosaic/pdf and the like: the operations of /rectify and /mosaic, each with one type of answer.

Generators of clients make one method of an operation with one return type. The work, the options and their limits are
those of /rectify and /mosaic.
"""

import asyncio
import json
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Form, Request, Response, UploadFile

from app.http.json_answers import JSON
from app.http.known_options import known_parts
from app.http.problems import documented
from app.openapi.plain_answers import PLAIN_MOSAIC, PLAIN_PAGES, PlainAnswer
from app.routes import mosaic, rectify
from app.routes.long_work import ACCEPTED, PREFER
from app.routes.page_answers import (
    BINARY,
    MOSAIC_HEADERS,
    PROBLEMS,
    RECTIFY_HEADERS,
    Documentation,
    add_failed_pages,
)
from app.routes.sent_uploads import MANY_FILES, UploadFormRoute
from app.schemas.mosaic import MosaicForm
from app.schemas.options import FORMAT
from app.schemas.rectify import RectifyForm
from app.state import State
from services.contract.answers.mosaic import MosaicResult
from services.contract.answers.rectify import PagesResult, RectifyResult
from services.contract.images import EmbeddedFormat, PageReply, TextFormat

router = APIRouter(route_class=UploadFormRoute, form_limits={"max_files": MANY_FILES})

Image = Annotated[EmbeddedFormat, FORMAT]
Text = Annotated[TextFormat, FORMAT]
Pdf = Annotated[Literal["pdf"], FORMAT]
Json = Annotated[Literal["json"], FORMAT]


class RectifyImageForm(RectifyForm):
    """The form of POST /rectify/image."""

    format: Image = "jpeg"


class RectifyPdfForm(RectifyForm):
    """The form of POST /rectify/pdf."""

    format: Pdf = "pdf"


class RectifyTextForm(RectifyForm):
    """The form of POST /rectify/text."""

    format: Text = "txt"


class RectifyPagesForm(RectifyForm):
    """The form of POST /rectify/pages."""

    format: Json = "json"


class MosaicImageForm(MosaicForm):
    """The form of POST /mosaic/image."""

    format: Image = "jpeg"


class MosaicPdfForm(MosaicForm):
    """The form of POST /mosaic/pdf."""

    format: Pdf = "pdf"


class MosaicJsonForm(MosaicForm):
    """The form of POST /mosaic/json."""

    format: Json = "json"


def _documented(
    description: str, content: dict[str, Any], *more: str, headers: dict[str, Any] | None = None
) -> Documentation:
    return {
        200: {"description": description, "content": content, "headers": headers or {}},
        **ACCEPTED,
        **documented(*PROBLEMS, *more),
    }


def _flat(description: str, *media_types: str) -> Documentation:
    return _documented(description, dict.fromkeys(media_types, BINARY), headers=RECTIFY_HEADERS)


def _joined(description: str, *media_types: str) -> Documentation:
    content = dict.fromkeys(media_types, BINARY)
    return _documented(description, content, _OVERLAP, headers=MOSAIC_HEADERS)


_IMAGES = ("image/jpeg", "image/png", "image/webp")
_TEXT = {"schema": {"type": "string"}}
_OVERLAP = "not-overlapping"


@router.post(
    "/rectify/image",
    operation_id="rectify_to_image",
    tags=["rectify"],
    response_class=Response,
    responses=_flat("The flat page.", *_IMAGES),
    openapi_extra=PREFER,
    dependencies=[known_parts(RectifyImageForm)],
)
async def rectify_to_image(
    request: Request, state: State, form: Annotated[RectifyImageForm, Form(media_type="multipart/form-data")]
) -> Response:
    """Flatten a photo of a page: /rectify with an image as its answer."""
    return await rectify.flatten(request, state, form)


@router.post(
    "/rectify/pdf",
    operation_id="rectify_to_pdf",
    tags=["rectify"],
    response_class=Response,
    responses=_flat("One PDF of all pages.", "application/pdf"),
    openapi_extra=PREFER,
    dependencies=[known_parts(RectifyPdfForm)],
)
async def rectify_to_pdf(
    request: Request, state: State, form: Annotated[RectifyPdfForm, Form(media_type="multipart/form-data")]
) -> Response:
    """Flatten photos of pages: /rectify with one PDF as its answer; with text=true it can be searched."""
    return await rectify.flatten(request, state, form)


@router.post(
    "/rectify/text",
    operation_id="rectify_to_text",
    tags=["rectify"],
    response_class=Response,
    responses=_documented(
        "The text of all pages.",
        dict.fromkeys(("text/plain", "text/markdown", "text/vnd.hocr+html", "application/alto+xml"), _TEXT),
        headers=RECTIFY_HEADERS,
    ),
    openapi_extra=PREFER,
    dependencies=[known_parts(RectifyTextForm)],
)
async def rectify_to_text(
    request: Request, state: State, form: Annotated[RectifyTextForm, Form(media_type="multipart/form-data")]
) -> Response:
    """Read photos of pages: /rectify with their text as its answer."""
    return await rectify.flatten(request, state, form)


@router.post(
    "/rectify/pages",
    operation_id="rectify_to_pages",
    tags=["rectify"],
    response_class=Response,
    responses=_documented(
        "All pages, in the order of the upload; also one page is a list.",
        {JSON: {"schema": PLAIN_PAGES.reference}},
    ),
    openapi_extra=PREFER,
    dependencies=[known_parts(RectifyPagesForm)],
)
async def rectify_to_pages(
    request: Request, state: State, form: Annotated[RectifyPagesForm, Form(media_type="multipart/form-data")]
) -> Response:
    """Flatten photos of pages: /rectify with always the same JSON, in which points are objects and nothing is null."""
    return await rectify.flatten(request, state, form, _answer_pages)


@router.post(
    "/mosaic/image",
    operation_id="mosaic_to_image",
    tags=["mosaic"],
    response_class=Response,
    responses=_joined("The whole page.", *_IMAGES),
    openapi_extra=PREFER,
    dependencies=[known_parts(MosaicImageForm)],
)
async def mosaic_to_image(
    request: Request, state: State, form: Annotated[MosaicImageForm, Form(media_type="multipart/form-data")]
) -> Response:
    """Join overlapping photos of one page: /mosaic with an image as its answer."""
    return await mosaic.join(request, state, form)


@router.post(
    "/mosaic/pdf",
    operation_id="mosaic_to_pdf",
    tags=["mosaic"],
    response_class=Response,
    responses=_joined("The whole page as a PDF.", "application/pdf"),
    openapi_extra=PREFER,
    dependencies=[known_parts(MosaicPdfForm)],
)
async def mosaic_to_pdf(
    request: Request, state: State, form: Annotated[MosaicPdfForm, Form(media_type="multipart/form-data")]
) -> Response:
    """Join overlapping photos of one page: /mosaic with a PDF as its answer; with text=true it can be searched."""
    return await mosaic.join(request, state, form)


@router.post(
    "/mosaic/json",
    operation_id="mosaic_to_json",
    tags=["mosaic"],
    response_class=Response,
    responses=_documented(
        "What is known of the page and its photos.", {JSON: {"schema": PLAIN_MOSAIC.reference}}, _OVERLAP
    ),
    openapi_extra=PREFER,
    dependencies=[known_parts(MosaicJsonForm)],
)
async def mosaic_to_json(
    request: Request, state: State, form: Annotated[MosaicJsonForm, Form(media_type="multipart/form-data")]
) -> Response:
    """Join overlapping photos of one page: /mosaic with JSON in which points are objects and nothing is null."""
    return await mosaic.join(request, state, form, _answer_mosaic)


async def _answer_pages(request: Request, reply: PageReply, photo: UploadFile, suffix: str) -> Response:
    """The pages as a list, also if there is one."""
    add_failed_pages(request, reply)
    answer = reply.answer
    if isinstance(answer, RectifyResult):
        answer = PagesResult(pages=[answer], warnings=[], timings_ms=answer.timings_ms)
    assert isinstance(answer, PagesResult)
    return await _answer_plain(answer, PLAIN_PAGES)


async def _answer_mosaic(request: Request, reply: PageReply, photo: UploadFile, suffix: str) -> Response:
    assert isinstance(reply.answer, MosaicResult)
    return await _answer_plain(reply.answer, PLAIN_MOSAIC)


async def _answer_plain(answer: PagesResult | MosaicResult, plain: PlainAnswer) -> Response:
    def write() -> str:
        document = plain.convert(answer.model_dump(mode="json", by_alias=True))
        return json.dumps(document, ensure_ascii=False, separators=(",", ":"))

    return Response(await asyncio.to_thread(write), media_type=JSON)
