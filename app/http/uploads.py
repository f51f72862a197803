"""Request bodies: admission before they are read, limits while they are read, refusals that clients can read.

Queue, length and keys are judged from the headers. Then the body is spooled, and the request takes a seat in the engine
when all of it is there. Limits of size and time may differ from path to path; a refusal names its setting.
"""

import asyncio
import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.engine.base import Admission as Seat
from app.engine.base import Engine
from app.http.paths import PathTemplates
from app.http.upload_places import BodyTooSlow, UploadPlaces
from services.errors import DocumentError, TooLarge

IS_JOB = "is_job"
"""Name in the state of a request: whether it will be stored as a job, and needs no worker now."""
_RATE_HOLDS_AFTER_S = 5.0
"""Time before the least rate of a body holds: connections start slowly, and phones pause."""


class ClientGone(DocumentError):
    """The client has disconnected."""

    code = "client-closed-request"


@dataclass(frozen=True, slots=True)
class BodyLimits:
    """Size and time limits of a body; `app.settings` documents them.

    `max_upload_bytes` limits a multipart form, whose files are spooled, `max_plain_bytes` every other body, which is
    kept in memory. `size_setting` and `plain_setting` are the settings behind them, which error messages name; empty:
    there is none.
    """

    max_upload_bytes: int
    max_plain_bytes: int
    body_timeout_s: float
    min_body_bytes_per_s: float
    max_drain_bytes: int
    drain_timeout_s: float
    size_setting: str
    plain_setting: str


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
        is_form = headers.get("content-type", "").strip().lower().startswith("multipart/form-data")
        self._most_bytes = limits.max_upload_bytes if is_form else limits.max_plain_bytes
        self._setting = limits.size_setting if is_form else limits.plain_setting
        self._received_bytes = 0
        self._begin_s: float | None = None
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
        if self._declared_bytes is not None and self._declared_bytes > self._most_bytes:
            raise self._too_large(f"{self._declared_bytes} bytes")
        now_s = time.monotonic()
        if self._begin_s is None:
            self._begin_s = now_s
        limits = self._limits
        by_rate_s = _RATE_HOLDS_AFTER_S + self._received_bytes / limits.min_body_bytes_per_s
        allowed_s = min(limits.body_timeout_s, by_rate_s)
        try:
            async with asyncio.timeout(max(0.0, self._begin_s + allowed_s - now_s)):
                message = await self._receive()
        except TimeoutError:
            if allowed_s < limits.body_timeout_s:
                raise BodyTooSlow(
                    f"The body arrived slower than {limits.min_body_bytes_per_s:g} bytes a second "
                    "(MIN_BODY_BYTES_PER_S). Send it again over a faster connection."
                ) from None
            raise BodyTooSlow(
                f"The body did not arrive within {limits.body_timeout_s:g} s (BODY_TIMEOUT_S)."
            ) from None
        self._note(message)
        if self._received_bytes > self._most_bytes:
            raise self._too_large("more")
        return message

    def _note(self, message: Message) -> None:
        if message["type"] == "http.request":
            self._received_bytes += len(message.get("body", b""))
        if message["type"] == "http.disconnect" or not message.get("more_body", False):
            self._body_over = True

    def _too_large(self, size: str) -> TooLarge:
        setting = f" ({self._setting})" if self._setting else ""
        return TooLarge(
            f"The request body is limited to {self._most_bytes} bytes{setting}; this one has {size}."
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


class UploadAdmission:
    """Middleware: a request for work gets a seat in the engine when its body is there.

    A full engine refuses before the body is read. While a body arrives, the request has one of the `places`. The seat
    is `request.state.seat`. The route releases it when the work is done; at the latest it is released with the
    response. `work` lists pairs of method and path template. Raises what `Engine.admit` and `UploadPlaces.enter` raise.
    """

    def __init__(
        self, app: ASGIApp, engine: Engine, work: Collection[tuple[str, str]], places: UploadPlaces
    ) -> None:
        self.app = app
        self.engine = engine
        self.work = frozenset(work)
        self.templates = PathTemplates(template for _, template in work)
        self.places = places

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or not self._is_work(scope):
            await self.app(scope, receive, send)
            return
        seat = _LateSeat(None if scope["state"].get(IS_JOB) else self.engine)
        scope.setdefault("state", {})["seat"] = seat
        seat.take()
        try:
            if _reads_body(scope):
                seat.release()
                await self._with_place(seat, scope, receive, send)
            else:
                await self.app(scope, receive, send)
        finally:
            seat.release()

    async def _with_place(self, seat: "_LateSeat", scope: Scope, receive: Receive, send: Send) -> None:
        place = self.places.enter()
        is_complete = False

        async def receive_then_sit() -> Message:
            nonlocal is_complete
            if is_complete:
                return await receive()
            message = await place.receive(receive)
            if message["type"] == "http.request" and not message.get("more_body", False):
                is_complete = True
                place.leave()
                seat.take()
            return message

        try:
            await self.app(scope, receive_then_sit, send)
        finally:
            place.leave()

    def _is_work(self, scope: Scope) -> bool:
        return (scope["method"], self.templates.match(scope["path"])) in self.work


class _LateSeat:
    """A seat that is taken after the request has begun."""

    def __init__(self, engine: Engine | None) -> None:
        """`engine` None: a request that becomes a job needs no seat."""
        self._engine = engine
        self._seat: Seat | None = None

    def take(self) -> None:
        """Take the seat. Raises what `Engine.admit` raises."""
        self._seat = None if self._engine is None else self._engine.admit()

    def release(self) -> None:
        """Release the seat if there is one."""
        seat, self._seat = self._seat, None
        if seat is not None:
            seat.release()


def _reads_body(scope: Scope) -> bool:
    """Whether the route reads a body to its end before it works. Routes of GET and DELETE read none."""
    if scope["method"] in ("GET", "DELETE"):
        return False
    headers = Headers(scope=scope)
    return "transfer-encoding" in headers or headers.get("content-length", "0") != "0"
