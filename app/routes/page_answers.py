"""Responses with a page: their format, headers and documentation."""

from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Any, Protocol

from fastapi import Request, Response, UploadFile
from pydantic import BaseModel

from app.http.json_answers import JSON, answer_json
from app.http.problems import described_problem, documented
from app.http.representations import (
    MEDIA_TYPES,
    choose_format,
    choose_pages_formats,
    content_disposition,
    file_stem,
    image_headers,
)
from app.routes.common_responses import FILE_NAME, FORM, IMAGE, WORK
from app.routes.document_uploads import format_of
from app.routes.long_work import ACCEPTED
from services.contract.answers.rectify import FailedPage, PagesResult, RectifyResult
from services.contract.images import MEDIA_TYPES as PAGES_MEDIA_TYPES
from services.contract.images import (
    AnswerFormat,
    ArchiveContent,
    EmbeddedFormat,
    Encoding,
    PageReply,
    PagesFormat,
    PdfVersion,
    SeveralFormat,
)

PageAnswer = Callable[[Request, PageReply, UploadFile, str], Awaitable[Response]]
"""Makes a response: see `answer_page`."""
Documentation = dict[int | str, dict[str, Any]]

BINARY = {"schema": {"type": "string", "format": "binary"}}
_COMMON_HEADERS = {
    **FILE_NAME,
    "Document-Rotation": {
        "description": "Clockwise degrees by which the page was turned upright.",
        "schema": {"type": "string", "enum": ["0", "90", "180", "270"]},
    },
    "Document-Warnings": {"description": "Codes, separated by commas.", "schema": {"type": "string"}},
    "Document-Page-Id": {
        "description": "Ids of the kept pages (keep_photo), separated by commas.",
        "schema": {"type": "string"},
    },
    "Server-Timing": {"description": "Milliseconds of each stage.", "schema": {"type": "string"}},
}
MOSAIC_HEADERS = {
    "Document-Unplaced": {
        "description": "Indices of the photos that could not be placed, separated by commas.",
        "schema": {"type": "string"},
    },
    **_COMMON_HEADERS,
}
"""Of files of /mosaic."""
RECTIFY_HEADERS = {
    "Document-Kind": {
        "description": "planar or curved; for several pages one value each, separated by commas.",
        "schema": {"type": "string"},
    },
    **_COMMON_HEADERS,
    "Document-Rotation": {
        "description": "Clockwise degrees by which each page was turned upright, separated by commas.",
        "schema": {"type": "string", "pattern": "^(0|90|180|270)(, (0|90|180|270))*$"},
    },
    "Document-Pages": {
        "description": "The number of pages, if there may be several.",
        "schema": {"type": "string"},
    },
    "Document-Advice": {
        "description": "Codes of advice for a better photo, separated by commas; empty for one that reads well.",
        "schema": {"type": "string"},
    },
    "Document-Failed": {
        "description": "Numbers (from 1) and problem codes of the pages that could not be flattened, as in "
        "`3 no-text, 5 undecodable-image`; the file leaves them out.",
        "schema": {"type": "string"},
    },
}
"""Of files of /rectify, and of kept pages."""
PROBLEMS = ("not-found", "not-acceptable", "conflict", "no-text", "internal", *FORM, *IMAGE, *WORK)


class AskedPicture(Protocol):
    """Form fields that determine the picture in the response."""

    quality: int | None
    embed: bool
    embed_format: EmbeddedFormat | None
    max_width: int | None
    max_height: int | None
    pdf_version: PdfVersion
    title: str | None


class AskedEncoding(AskedPicture, Protocol):
    """Form fields that determine the format of the response."""

    format: AnswerFormat | None


class AskedPagesEncoding(AskedPicture, Protocol):
    """Form fields that determine the format of a response that may have several pages."""

    format: PagesFormat | None
    archive: ArchiveContent


def documented_page(
    model: type[BaseModel],
    headers: dict[str, Any],
    problems: tuple[str, ...] = (),
    pages_model: type[BaseModel] | None = None,
) -> Documentation:
    """OpenAPI responses of a route that responds with a page image or with `model`.

    Parameters
    ----------
    model
        The JSON response.
    headers
        Those of its files.
    problems
        Problem codes in addition to the common ones.
    pages_model
        The JSON response with several pages; None: there is always one page.
    """
    media_types = MEDIA_TYPES.values() if pages_model is None else PAGES_MEDIA_TYPES.values()
    return {
        200: {
            "description": "The flat page, or its description as JSON; the headers come with images only.",
            "model": model if pages_model is None else model | pages_model,
            "content": {media_type: BINARY for media_type in media_types if media_type != JSON},
            "headers": headers,
        },
        **ACCEPTED,
        **documented(*PROBLEMS, *problems),
    }


async def choose_encoding(request: Request, asked: AskedEncoding, photo: UploadFile) -> Encoding:
    """Format of the response: by the form or by `Accept`, else the photo's own format.

    Raises
    ------
    NotAcceptable
        When `Accept` allows no format.
    """
    accept, own = request.headers.get("accept"), await format_of(photo)
    return _encoding_of(asked, photo, choose_format(asked.format, accept, own), "pdf")


async def choose_pages_encoding(request: Request, asked: AskedPagesEncoding, photo: UploadFile) -> Encoding:
    """Format as by `choose_encoding`, for a response that may have several pages.

    Raises
    ------
    NotAcceptable
        When `Accept` allows no format.
    """
    accept, own = request.headers.get("accept"), await format_of(photo)
    single, several = choose_pages_formats(asked.format, accept, own)
    return replace(_encoding_of(asked, photo, single, several), archive=asked.archive)


def _encoding_of(
    asked: AskedPicture, photo: UploadFile, chosen: PagesFormat | None, several: SeveralFormat | None
) -> Encoding:
    return Encoding(
        format=chosen,
        quality=asked.quality,
        embed=asked.embed or asked.embed_format is not None,
        pages_format=several,
        embed_format=asked.embed_format,
        max_width=asked.max_width,
        max_height=asked.max_height,
        pdf_version=asked.pdf_version,
        title=asked.title or file_stem(photo.filename),
    )


def flat_pages(reply: PageReply) -> list[RectifyResult]:
    """The answers about the flat pages of a reply of /rectify."""
    if isinstance(reply.answer, PagesResult):
        return [page for page in reply.answer.pages if isinstance(page, RectifyResult)]
    assert isinstance(reply.answer, RectifyResult)
    return [reply.answer]


def add_failed_pages(request: Request, reply: PageReply) -> None:
    """Put the problems of pages that failed among the pages of the answer."""
    if isinstance(reply.answer, PagesResult):
        for each in reply.failed:
            problem = described_problem(each.code, each.detail, each.field, request.state.request_id)
            reply.answer.pages.insert(each.place, FailedPage(problem=problem))


async def answer_page(request: Request, reply: PageReply, photo: UploadFile, suffix: str) -> Response:
    """Response with the image and its headers, or with its description.

    A saved image gets the file name of `photo` with `suffix`.
    """
    add_failed_pages(request, reply)
    if reply.media_type == JSON:
        return await answer_json(lambda: reply.answer, headers={"Vary": "Accept"})
    headers = image_headers(reply.answer) | {"Vary": "Accept"}
    headers |= content_disposition(photo.filename, suffix, reply.media_type)
    return Response(reply.body, media_type=reply.media_type, headers=headers)
