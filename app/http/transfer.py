"""How responses travel: HEAD, OPTIONS, conditional GET, and paths behind a prefix."""

import hashlib
from collections.abc import Mapping
from http import HTTPStatus

from anyio import to_thread
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.paths import PathTemplates

LOCATIONS = ("Location", "Document-Result")
"""Response headers that hold a path of this service."""
_LARGE_BYTES = 1 << 18


class RootPath:
    """Middleware: serves the app under a prefix (`ROOT_PATH`), whether or not the proxy in front removes it.

    Paths in response headers get the prefix, which clients need.
    """

    def __init__(self, app: ASGIApp, root_path: str) -> None:
        self.app = app
        self.root_path = root_path

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or not self.root_path:
            await self.app(scope, receive, send)
            return
        path = scope["path"]
        if path.startswith(self.root_path + "/"):
            scope = {**scope, "path": path.removeprefix(self.root_path)}

        async def send_with_prefix(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name in LOCATIONS:
                    if headers.get(name, "").startswith("/"):
                        headers[name] = self.root_path + headers[name]
            await send(message)

        await self.app(scope, receive, send_with_prefix)


class HeadAndOptions:
    """Middleware: answers HEAD like GET without the body, and OPTIONS with the methods of the path."""

    def __init__(
        self, app: ASGIApp, methods: Mapping[str, frozenset[str]], more: Mapping[str, Mapping[str, str]]
    ) -> None:
        """`methods` are those of each path template, `more` further headers that OPTIONS has for some of them."""
        self.app = app
        self.methods = methods
        self.more = more
        self.templates = PathTemplates(methods)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        template = self.templates.match(scope["path"]) if scope["type"] == "http" else None
        if template is None:
            await self.app(scope, receive, send)
        elif scope["method"] == "OPTIONS":
            headers = {"Allow": allowed(self.methods[template]), **self.more.get(template, {})}
            await Response(status_code=HTTPStatus.NO_CONTENT, headers=headers)(scope, receive, send)
        elif scope["method"] == "HEAD" and "GET" in self.methods[template]:
            await self._head(scope, receive, send)
        else:
            await self.app(scope, receive, send)

    async def _head(self, scope: Scope, receive: Receive, send: Send) -> None:
        is_over = False

        async def send_head(message: Message) -> None:
            nonlocal is_over
            if message["type"] == "http.response.start":
                await send(message)
            elif not is_over:
                is_over = True
                await send({"type": "http.response.body", "body": b"", "more_body": False})
            if is_over and message.get("more_body"):
                raise OSError("the rest of the body is not needed")  # ends a stream of events

        try:
            await self.app({**scope, "method": "GET"}, receive, send_head)
        except (OSError, ClientDisconnect):
            if not is_over:
                raise


def allowed(methods: frozenset[str]) -> str:
    """Value of the header `Allow` for a path with these methods."""
    more = {"OPTIONS", "HEAD"} if "GET" in methods else {"OPTIONS"}
    return ", ".join(sorted(methods | more))


class ConditionalGet:
    """Middleware: every complete response to GET has an entity tag; `If-None-Match` with it gets 304 without a body.

    The tag of a response that has none is a hash of its body. Streams have no tag.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "GET":
            await self.app(scope, receive, send)
            return
        wanted = Headers(scope=scope).get("if-none-match")
        start: Message | None = None

        async def send_if_changed(message: Message) -> None:
            nonlocal start
            if message["type"] == "http.response.start" and message["status"] == HTTPStatus.OK:
                start = message
                return
            if start is not None:
                first, start = start, None
                if not message.get("more_body"):
                    headers = MutableHeaders(scope=first)
                    tag = headers.get("ETag") or await _tag_of(message.get("body", b""))
                    headers["ETag"] = tag
                    if wanted is not None and _matches(wanted, tag):
                        del headers["content-length"]
                        first = {**first, "status": HTTPStatus.NOT_MODIFIED.value}
                        message = {**message, "body": b""}
                await send(first)
            await send(message)

        await self.app(scope, receive, send_if_changed)


async def _tag_of(body: bytes) -> str:
    """Entity tag of a body; a large one is read in a thread, not in the event loop."""
    is_large = len(body) > _LARGE_BYTES
    digest = await to_thread.run_sync(hashlib.sha256, body) if is_large else hashlib.sha256(body)
    return f'"{digest.hexdigest()[:32]}"'


def _matches(wanted: str, tag: str) -> bool:
    """Whether an `If-None-Match` header names the tag (RFC 9110, 13.1.2: weak comparison)."""
    names = [name.strip().removeprefix("W/") for name in wanted.split(",")]
    return wanted.strip() == "*" or tag.removeprefix("W/") in names
