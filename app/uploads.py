"""Request bodies: admission before they are read, limits while they are read, refusals that clients can read."""

import asyncio
import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.engine.base import Engine
from app.paths import PathTemplates
from services.errors import DocumentError, TooLarge


class BodyTooSlow(DocumentError):
    """The body did not arrive in time."""

    code = "request-timeout"


class ClientGone(DocumentError):
    """The client has disconnected."""

    code = "client-closed-request"


@dataclass(frozen=True, slots=True)
class BodyLimits:
    """Size and time limits of a body; `app.settings` documents each under the same name.

    `size_setting` is the name of the setting behind `max_upload_bytes`; error messages name it.
    """

    max_upload_bytes: int
    body_timeout_s: float
    max_drain_bytes: int
    drain_timeout_s: float
    size_setting: str = "MAX_UPLOAD_BYTES"


class BodyGuard:
    """Middleware: enforces the body limits, and makes sure that a client can read every refusal.

    If a server closes a connection while bytes still arrive, the client sees a connection reset instead of the
    response. Therefore a response that precedes the end of the body is sent completely. Then a limited rest of the body
    is read and discarded, and the connection is closed.
    """

    def __init__(self, app: ASGIApp, limits: BodyLimits, of_path: Mapping[str, BodyLimits]) -> None:
        """`limits` apply to every path without a template in `of_path`."""
        self.app = app
        self.limits = limits
        self.of_path = of_path
        self.templates = PathTemplates(of_path)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        template = self.templates.match(scope["path"])
        limits = self.limits if template is None else self.of_path[template]
        exchange = _Exchange(Headers(scope=scope), receive, send, limits)
        await self.app(scope, exchange.receive, exchange.send)


class _Exchange:
    """Body and response of one request."""

    def __init__(self, headers: Headers, receive: Receive, send: Send, limits: BodyLimits) -> None:
        length = headers.get("content-length", "")
        self._declared_bytes = int(length) if length.isascii() and length.isdigit() else None
        self._body_over = "transfer-encoding" not in headers and not self._declared_bytes
        self._receive = receive
        self._send = send
        self._limits = limits
        self._received_bytes = 0
        self._deadline: float | None = None
        self._closing = False

    async def receive(self) -> Message:
        """The next part of the body.

        Raises
        ------
        TooLarge, BodyTooSlow
            When a limit is exceeded.
        """
        if self._body_over:
            return await self._receive()
        limit = self._limits.max_upload_bytes
        if self._declared_bytes is not None and self._declared_bytes > limit:
            raise self._too_large(f"{self._declared_bytes} bytes")
        now = time.monotonic()
        if self._deadline is None:
            self._deadline = now + self._limits.body_timeout_s
        try:
            async with asyncio.timeout(max(0.0, self._deadline - now)):
                message = await self._receive()
        except TimeoutError:
            raise BodyTooSlow(
                f"The body did not arrive within {self._limits.body_timeout_s:g} s (BODY_TIMEOUT_S)."
            ) from None
        self._note(message)
        if self._received_bytes > limit:
            raise self._too_large("more")
        return message

    def _note(self, message: Message) -> None:
        if message["type"] == "http.request":
            self._received_bytes += len(message.get("body", b""))
        if message["type"] == "http.disconnect" or not message.get("more_body", False):
            self._body_over = True

    def _too_large(self, size: str) -> TooLarge:
        return TooLarge(
            f"The request body is limited to {self._limits.max_upload_bytes} bytes "
            f"({self._limits.size_setting}); this one has {size}."
        )

    async def send(self, message: Message) -> None:
        """Send the response; before its last message, read the rest of the body."""
        if message["type"] == "http.response.start" and not self._body_over:
            self._closing = True
            message = {**message, "headers": [*message.get("headers", ()), (b"connection", b"close")]}
        last = message["type"] == "http.response.body" and not message.get("more_body", False)
        if not (last and self._closing):
            await self._send(message)
            return
        await self._send({**message, "more_body": True})
        await self._drain()
        await self._send({"type": "http.response.body", "body": b"", "more_body": False})

    async def _drain(self) -> None:
        bound = self._received_bytes + self._limits.max_drain_bytes
        try:
            async with asyncio.timeout(self._limits.drain_timeout_s):
                while not self._body_over and self._received_bytes < bound:
                    self._note(await self._receive())
        except TimeoutError:
            pass


class Admission:
    """Middleware: a request for work takes a seat in the engine before its body is read.

    The seat is `request.state.seat`. The route releases it when the work is done; at the latest it is released with the
    response. `work` lists pairs of method and path template. Raises what `Engine.admit` raises.
    """

    def __init__(self, app: ASGIApp, engine: Engine, work: Collection[tuple[str, str]]) -> None:
        self.app = app
        self.engine = engine
        self.work = frozenset(work)
        self.templates = PathTemplates(template for _, template in work)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or not self._is_work(scope):
            await self.app(scope, receive, send)
            return
        seat = self.engine.admit()
        scope.setdefault("state", {})["seat"] = seat
        try:
            await self.app(scope, receive, send)
        finally:
            seat.release()

    def _is_work(self, scope: Scope) -> bool:
        return (scope["method"], self.templates.match(scope["path"])) in self.work
