"""A request as data: it is stored, and done later through the same route, in this process or on another machine.

So the answer of a job is that of the request by construction, and a new route needs nothing of its own.
"""

import secrets
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass

from fastapi import Request
from starlette.datastructures import FormData, Headers, UploadFile
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Scope

from app.http.form_parts import READ_BYTES, has_form
from app.logs import trace_of
from models.job_records import RequestJson
from services.progress import ProgressSink

_KEPT_HEADERS = ("accept", "if-match", "if-none-match")
"""Headers that change an answer."""
RUN = "job_run"
"""Name in the state of a request under which a job's `JobRun` is."""


class StubSeat:
    """The seat of a request that is done as a job: jobs are admitted by the queue, and hold none."""

    def release(self) -> None:
        """Nothing to release."""


@dataclass(frozen=True, slots=True)
class JobRun:
    """What a route finds in the state of a request that is done as a job."""

    report: ProgressSink


def describe_request(request: Request, content_type: str | None) -> RequestJson:
    """A request without its body, as JSON. `content_type` is that of the stored body."""
    headers = {name: request.headers[name] for name in _KEPT_HEADERS if name in request.headers}
    headers |= trace_of(request.headers)
    if content_type is not None:
        headers["content-type"] = content_type
    return {
        "method": request.method,
        "path": request.scope["path"],
        "query": request.scope["query_string"].decode("latin-1"),
        "headers": headers,
        "request_id": request.state.request_id,
        "caller": request.state.caller,
        "role": request.state.role,
    }


async def body_of(request: Request) -> tuple[Iterator[bytes], int, str | None]:
    """The body of a request that its route has read: its parts, most bytes of all parts, and its content type.

    A form is put together again from its parts, which lie in temporary files.
    """
    if has_form(request.headers):
        form = await request.form()
        boundary = secrets.token_hex(16)
        sizes = sum(
            (part.size or 0) if isinstance(part, UploadFile) else len(part) for _, part in form.multi_items()
        )
        return _form_parts(form, boundary), sizes, f"multipart/form-data; boundary={boundary}"
    body = await request.body()
    return iter([body] if body else []), len(body), request.headers.get("content-type")


def _form_parts(form: FormData, boundary: str) -> Iterator[bytes]:
    """Yield the form as multipart/form-data. The files are read in the thread that asks."""
    for name, part in form.multi_items():
        yield f"--{boundary}\r\n".encode()
        if not isinstance(part, UploadFile):
            head = Headers({"Content-Disposition": f'form-data; name="{_quoted(name)}"'})
            yield _head(head) + part.encode("utf-8", "surrogatepass") + b"\r\n"
            continue
        yield _head(part.headers)
        part.file.seek(0)
        while data := part.file.read(READ_BYTES):
            yield data
        part.file.seek(0)
        yield b"\r\n"
    yield f"--{boundary}--\r\n".encode()


def _head(headers: Headers) -> bytes:
    return b"".join(name + b": " + value + b"\r\n" for name, value in headers.raw) + b"\r\n"


def _quoted(name: str) -> str:
    return name.replace('"', "%22").replace("\r", "%0D").replace("\n", "%0A")


async def do_request(
    app: ASGIApp, fastapi: object, stored: RequestJson, body: AsyncIterator[bytes], run: JobRun
) -> Response:
    """The response of `app` to a stored request. `fastapi` is the application whose state the routes use."""
    headers = [(name.encode("latin-1"), value.encode("latin-1")) for name, value in stored["headers"].items()]
    scope: Scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": stored["method"],
        "scheme": "http",
        "path": stored["path"],
        "raw_path": stored["path"].encode("utf-8", "surrogatepass"),
        "root_path": "",
        "query_string": stored["query"].encode("latin-1"),
        "headers": headers,
        "client": None,
        "server": None,
        "app": fastapi,
        "state": {
            "request_id": stored["request_id"],
            "key": None,
            "caller": stored["caller"],
            # Jobs of earlier releases have none: they see what their key has made.
            "role": stored.get("role"),
            "seat": StubSeat(),
            RUN: run,
        },
    }

    async def receive() -> Message:
        part = await anext(body, None)
        return {"type": "http.request", "body": part or b"", "more_body": part is not None}

    response = Response()
    sent: list[bytes] = []

    async def send(message: Message) -> None:
        if message["type"] == "http.response.start":
            response.status_code, response.raw_headers = message["status"], list(message.get("headers", ()))
        else:
            sent.append(message.get("body", b""))

    await app(scope, receive, send)
    response.body = b"".join(sent)
    return response
