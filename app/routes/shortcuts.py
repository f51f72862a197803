"""POST /rectify/image, /mosaic/pdf and the like: the operations of /rectify and /mosaic, each with one type of answer.

Generators of clients make one method of an operation with one return type. The work, the options and their limits are
those of /rectify and /mosaic.
"""

import asyncio
import json
from collections.abc import Awaitable, Callable, Mapping
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Form, Request, Response, UploadFile
from pydantic import create_model

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
    PageAnswer,
    add_failed_pages,
    answer_page,
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

_TEXTS = ("text/plain", "text/markdown", "text/vnd.hocr+html", "application/alto+xml")
_FORMATS: Mapping[str, tuple[Any, str, Mapping[str, Any]]] = {
    "image": (EmbeddedFormat, "jpeg", dict.fromkeys(("image/jpeg", "image/png", "image/webp"), BINARY)),
    "pdf": (Literal["pdf"], "pdf", {"application/pdf": BINARY}),
    "text": (TextFormat, "txt", {media_type: {"schema": {"type": "string"}} for media_type in _TEXTS}),
    "pages": (Literal["json"], "json", {JSON: {"schema": PLAIN_PAGES.reference}}),
    "json": (Literal["json"], "json", {JSON: {"schema": PLAIN_MOSAIC.reference}}),
}
"""By the end of the path: the values of `format`, its default, and the content of the answer."""


def _add(flow: Literal["rectify", "mosaic"], to: str, returns: str, does: str) -> None:
    """Add the route /`flow`/`to`, which `does` something and `returns` it: its form has one kind of `format`."""
    kind, default, content = _FORMATS[to]
    is_file = to not in _ANSWERS
    answer = _ANSWERS.get(to, answer_page)
    work: Callable[..., Awaitable[Response]] = rectify.flatten if flow == "rectify" else mosaic.join
    form = create_model(
        f"{flow.capitalize()}{to.capitalize()}Form",
        __base__=RectifyForm if flow == "rectify" else MosaicForm,
        __doc__=f"The form of POST /{flow}/{to}.",
        format=(Annotated[kind, FORMAT], default),
    )

    async def run(request: Request, state: State, form: Any) -> Response:
        return await work(request, state, form, answer)

    run.__annotations__["form"] = Annotated[form, Form(media_type="multipart/form-data")]
    headers = RECTIFY_HEADERS if flow == "rectify" else MOSAIC_HEADERS
    ok = {"description": returns, "content": dict(content), "headers": headers if is_file else {}}
    problems = (*PROBLEMS, "not-overlapping") if flow == "mosaic" else PROBLEMS
    router.add_api_route(
        f"/{flow}/{to}",
        run,
        methods=["POST"],
        name=f"{flow}_to_{to}",
        operation_id=f"{flow}_to_{to}",
        description=does,
        tags=[flow],
        response_class=Response,
        responses={200: ok, **ACCEPTED, **documented(*problems)},
        openapi_extra=PREFER,
        dependencies=[known_parts(form)],
    )


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


_ANSWERS: Mapping[str, PageAnswer] = {"pages": _answer_pages, "json": _answer_mosaic}
_FLAT, _JOIN = "Flatten photos of pages: /rectify with", "Join overlapping photos of one page: /mosaic with"
_SEARCHED = "with text=true it can be searched."
_PLAIN = "in which points are objects and nothing is null."
_add("rectify", "image", "The flat page.", "Flatten a photo of a page: /rectify with an image as its answer.")
_add("rectify", "pdf", "One PDF of all pages.", f"{_FLAT} one PDF as its answer; {_SEARCHED}")
_add(
    "rectify",
    "text",
    "The text of all pages.",
    "Read photos of pages: /rectify with their text as its answer.",
)
_EACH = "All pages, in the order of the upload; also one page is a list."
_add("rectify", "pages", _EACH, f"{_FLAT} always the same JSON, {_PLAIN}")
_add("mosaic", "image", "The whole page.", f"{_JOIN} an image as its answer.")
_add("mosaic", "pdf", "The whole page as a PDF.", f"{_JOIN} a PDF as its answer; {_SEARCHED}")
_add("mosaic", "json", "What is known of the page and its photos.", f"{_JOIN} JSON {_PLAIN}")
