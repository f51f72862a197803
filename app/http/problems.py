"""Errors as `application/problem+json` (RFC 9457). Only this module knows status codes."""

import asyncio
import errno
import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from http import HTTPStatus

from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.engine.base import Busy, JobFailed
from app.http.paths import PathTemplates
from app.http.preconditions import PreconditionFailed
from app.http.transfer import allowed
from app.schemas.options import WRONG_NUMBER_OF_FILES
from models.errors import StoreError, StoreUnavailable
from services.contract.answers.problem import Problem
from services.errors import DocumentError

log = logging.getLogger(__name__)

MEDIA_TYPE = "application/problem+json"

STATUS_OF_CODE: Mapping[str, int] = {
    "bad-request": 400,
    "unauthorized": 401,
    "forbidden": 403,
    "not-found": 404,
    "method-not-allowed": 405,
    "not-acceptable": 406,
    "request-timeout": 408,
    "conflict": 409,
    "not-finished": 409,
    "cancelled": 410,
    "store-full": 409,
    "too-large": 413,
    "out-of-memory": 413,
    "unsupported-media-type": 415,
    "undecodable-image": 422,
    "invalid-option": 422,
    "no-text": 422,
    "not-overlapping": 422,
    "invalid-model": 422,
    "no-samples": 422,
    "not-storable": 422,
    "wrong-offset": 409,
    "checksum-mismatch": 460,
    "client-closed-request": 499,
    "internal": 500,
    "worker-died": 500,
    "busy": 503,
    "not-ready": 503,
    "shutting-down": 503,
    "store-unavailable": 503,
    "timed-out": 504,
}
"""HTTP status of every problem code. 499 appears only in logs, because the client has disconnected."""

MEANING_OF_CODE: Mapping[str, str] = {
    "bad-request": "Not multipart/form-data, or a part is missing.",
    "unauthorized": "API keys are configured and the request has none.",
    "forbidden": "The API key is not valid.",
    "not-found": "There is no such resource.",
    "method-not-allowed": "The resource does not support this method; `Allow` lists the supported ones.",
    "not-acceptable": "No representation fits `Accept`.",
    "request-timeout": "The request body did not arrive within BODY_TIMEOUT_S, or slower than MIN_BODY_BYTES_PER_S.",
    "conflict": "The model changed since it was read, or an Idempotency-Key came with a different request.",
    "not-finished": "The job has no result yet.",
    "cancelled": "The job was cancelled; it has no result and will have none.",
    "store-full": "The limit MAX_MODELS or MAX_SAMPLES_PER_MODEL is reached.",
    "too-large": "More bytes, megapixels or pages than a limit allows; checked before decoding.",
    "out-of-memory": "The work needs more memory than WORKER_MEMORY_BYTES.",
    "unsupported-media-type": "Not an accepted image format.",
    "undecodable-image": "The image or PDF is truncated or damaged, or the PDF is encrypted.",
    "invalid-option": "An option is unknown, malformed or out of its range; `field` names it.",
    "no-text": "The image shows neither enough printed text nor sheet edges to find the page's shape.",
    "not-overlapping": "No two of the photos show the same part of a page.",
    "invalid-model": "Not a layout model, or a model in a newer format than this service reads.",
    "no-samples": "The model has no samples to be initialized from.",
    "not-storable": "A name or key has characters that cannot be stored.",
    "wrong-offset": "A piece does not begin where its upload ends; ask for the offset, and go on from there.",
    "checksum-mismatch": "A piece of an upload is not what its checksum says; it was not kept. Send it again.",
    "client-closed-request": "The client closed the connection before the response.",
    "internal": "A defect of the service.",
    "worker-died": "The worker process ended before the work was done; try again.",
    "busy": "All workers and the queue are in use; try again after `Retry-After` seconds.",
    "not-ready": "No worker is up.",
    "shutting-down": "The service is stopping; try again after `Retry-After` seconds.",
    "store-unavailable": "The store cannot be read or written now, or its disk is full; try again later.",
    "timed-out": "The work exceeded its limit (JOB_TIMEOUT_S, MOSAIC_TIMEOUT_S, DOCUMENT_TIMEOUT_S, MODEL_TIMEOUT_S) "
    "and was stopped.",
}

_DISK_FULL = frozenset({errno.ENOSPC, errno.EDQUOT})
_CODE_OF_STATUS = {400: "bad-request", 404: "not-found", 405: "method-not-allowed", 413: "too-large"}
"""Problem codes of requests that the framework refuses."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """A problem, not yet bound to a request."""

    code: str
    detail: str
    field: str | None = None
    headers: tuple[tuple[str, str], ...] = ()
    is_precondition: bool = False

    @property
    def status(self) -> int:
        return 412 if self.is_precondition else STATUS_OF_CODE[self.code]


def refusal_of(error: BaseException) -> Refusal:
    """Problem that a client receives for `error`. Unexpected errors give no details."""
    if isinstance(error, DocumentError) and error.code in MEANING_OF_CODE and error.code != "internal":
        is_precondition = isinstance(error, PreconditionFailed)
        return Refusal(error.code, error.detail, error.field, _headers_of(error), is_precondition)
    if isinstance(error, StoreError) and error.code in MEANING_OF_CODE and error.code != "internal":
        return Refusal(error.code, _sentence(error.detail))
    if isinstance(error, RequestValidationError):
        return _refusal_of_validation(error)
    if isinstance(error, HTTPException):
        return _refusal_of_http(error)
    if isinstance(error, ClientDisconnect):
        return _gone()
    is_disk_full = isinstance(error, OSError) and error.errno in _DISK_FULL
    return _no_space() if is_disk_full else _internal()


class ProblemBoundary:
    """Middleware: turns every exception into a problem document, so that a client never sees a traceback."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        started = False

        async def noting_send(message: Message) -> None:
            nonlocal started
            started = started or message["type"] == "http.response.start"
            await send(message)

        try:
            await self.app(scope, receive, noting_send)
        except asyncio.CancelledError:  # the grace period of a shutdown has ended
            if not started:
                refusal = Refusal(
                    "shutting-down", "The service is shutting down.", None, (("Retry-After", "1"),)
                )
                await _response_for(refusal, scope)(scope, receive, send)
            raise
        except Exception as error:
            if started:
                raise
            await problem_response(error, scope)(scope, receive, send)


class FrameworkErrors:
    """Exception handler for requests that the framework refuses."""

    def __init__(self, methods: Mapping[str, frozenset[str]]) -> None:
        """`methods` are those of each path template."""
        self._methods = methods
        self._templates = PathTemplates(methods)

    async def __call__(self, request: Request, error: Exception) -> Response:
        refusal = refusal_in(error, request.scope)
        template = self._templates.match(request.scope["path"])
        if refusal.code == "method-not-allowed" and template is not None:
            # The framework lists only the methods of the first route with this path.
            refusal = replace(refusal, headers=(("Allow", allowed(self._methods[template])),))
        return _response_for(refusal, request.scope)


def problem_response(error: Exception, scope: Scope) -> Response:
    """The problem document for an error of a request; errors of the service itself are logged."""
    return _response_for(refusal_in(error, scope), scope)


def refusal_in(error: Exception, scope: Scope) -> Refusal:
    """The problem of `error` in a request, or in a part of one. Defects are logged with their cause."""
    refusal = refusal_of(error)
    if refusal.status == 500 or isinstance(error, StoreUnavailable):
        extra = {"request_id": scope["state"]["request_id"], "code": refusal.code}
        if isinstance(error, JobFailed):
            log.error("operation failed: %s", error.detail, extra={**extra, "traceback": error.traceback})
        else:
            foreseen = isinstance(error, DocumentError | StoreError)
            log.error("request failed: %s", error, extra=extra, exc_info=None if foreseen else error)
    return refusal


def _response_for(refusal: Refusal, scope: Scope) -> Response:
    state = scope["state"]
    state["problem_code"] = refusal.code
    return response_for(refusal, state["request_id"])


def response_for(refusal: Refusal, request_id: str) -> Response:
    """The problem document of one request."""
    body = _problem_of(refusal, request_id)
    return Response(
        body.model_dump_json(exclude_none=True), refusal.status, dict(refusal.headers), media_type=MEDIA_TYPE
    )


def _problem_of(refusal: Refusal, request_id: str) -> Problem:
    return Problem(
        title=_TITLES.get(refusal.status) or HTTPStatus(refusal.status).phrase,
        status=refusal.status,
        code=refusal.code,
        detail=refusal.detail,
        field=refusal.field,
        request_id=request_id,
    )


def described_problem(code: str, detail: str, field: str | None, request_id: str) -> Problem:
    """The problem of a part of the request, for a document that also has what succeeded."""
    return _problem_of(Refusal(code, detail, field), request_id)


def documented(
    *codes: str, conditional: bool = False, of_tus: bool = False
) -> dict[int | str, dict[str, object]]:
    """OpenAPI problem responses for these codes.

    Routes that accept If-Match (`conditional`) or want the version of tus (`of_tus`) have 412 in addition.
    """
    meanings = {
        status: [f"`{code}`: {MEANING_OF_CODE[code]}" for code in codes if STATUS_OF_CODE[code] == status]
        for status in sorted({STATUS_OF_CODE[code] for code in codes})
    }
    if conditional:
        meanings[412] = ["`conflict`: The model does not meet If-Match or If-None-Match."]
    if of_tus:
        meanings[412] = ["`conflict`: `Tus-Resumable` is missing, or names another version."]
    responses: dict[int | str, dict[str, object]] = {}
    for status, meaning in meanings.items():
        responses[status] = {
            "description": " ".join(meaning),
            "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}},
        }
        if status == 503:
            responses[status]["headers"] = {
                "Retry-After": {"description": "Seconds.", "schema": {"type": "integer", "minimum": 1}}
            }
    return responses


_TITLES = {460: "Checksum Mismatch", 499: "Client Closed Request"}
_PHRASES = frozenset(status.phrase for status in HTTPStatus)


def _internal() -> Refusal:
    return Refusal(
        "internal", "The service failed on this request. Its log has the cause under this request_id."
    )


def _no_space() -> Refusal:
    return Refusal(
        "store-unavailable", "The service has no disk space left for this upload. Send it again later."
    )


def _gone() -> Refusal:
    return Refusal("client-closed-request", MEANING_OF_CODE["client-closed-request"])


def _headers_of(error: DocumentError) -> tuple[tuple[str, str], ...]:
    if isinstance(error, Busy):
        return (("Retry-After", str(error.retry_after_s)),)
    if error.code == "unauthorized":
        schemes = (
            'ApiKey realm="document-rectification", header="X-API-Key", Bearer realm="document-rectification"'
        )
        return (("WWW-Authenticate", schemes),)
    return ()


def _refusal_of_http(error: HTTPException) -> Refusal:
    """Problem of an error of the framework; also of errors while it reads the body."""
    # With a disk that fails, the body could not be spooled; the request is valid.
    if isinstance(error.__cause__, DocumentError | StoreError | ClientDisconnect | OSError):
        return refusal_of(error.__cause__)
    if error.status_code not in _CODE_OF_STATUS:
        return _internal()
    code = _CODE_OF_STATUS[error.status_code]
    detail = MEANING_OF_CODE[code] if error.detail in _PHRASES else str(error.detail)
    return Refusal(code, detail, None, tuple((error.headers or {}).items()))


def _refusal_of_validation(error: RequestValidationError) -> Refusal:
    """Problem of the first validation error. A missing file is `bad-request`, a wrong value `invalid-option`."""
    first = error.errors()[0]
    place = [str(part) for part in first["loc"]]
    field = place[1] if len(place) > 1 else None
    if field and place[0] == "header":
        field = (
            field.title()
        )  # the framework has small letters; documentation and clients write Upload-Length
    if first["type"] == WRONG_NUMBER_OF_FILES:
        return Refusal("invalid-option", f"{field}: {first['msg']}", field)
    if field is None or field in _FILE_FIELDS:
        name = field or "body"
        if first["type"] == "missing":
            photos = _FILE_FIELDS.get(name, "the photo as a file part")
            return Refusal("bad-request", f"{name}: send {photos} of multipart/form-data.", field)
        return Refusal("bad-request", f"{name}: this part must be a file (with a filename).", field)
    if first["type"] == "extra_forbidden":
        return Refusal("invalid-option", f"{field}: there is no such option.", field)
    if first["type"] == "missing":
        return Refusal("invalid-option", f"{field}: it must be sent.", field)
    reason = str(first["msg"]).removeprefix("Value error, ")
    return Refusal("invalid-option", f"{field}: {reason}; got {_shown(first.get('input'))}.", field)


_FILE_FIELDS = {
    "image": "the photo as a file part",
    "images": "each photo as a file part of this name",
    "zones_file": "the zones as a file part",
}
"""Fields that hold files, and what the client must send in them."""


def _sentence(words: str) -> str:
    """A detail from the store as a sentence: it starts with a small letter and has no full stop."""
    return words[:1].upper() + words[1:] + "."


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
