"""Structured logs: one JSON object per line, one line per request, with the request id."""

import json
import logging
import re
import sys
import time
import uuid
from datetime import UTC, datetime
from io import TextIOWrapper

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.metrics import Metrics

HEADER = "X-Request-ID"
TRACE_HEADER = "traceparent"
_TRACE = re.compile("[0-9a-f]{2}-[0-9a-f]{32}-[0-9a-f]{16}-[0-9a-f]{2}")
_GOOD_REQUEST_ID = re.compile(r"[A-Za-z0-9._~+/=:@-]{1,128}")
_PLAIN_FIELDS = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "color_message"}
log = logging.getLogger("app.requests")


class JsonFormatter(logging.Formatter):
    """Formats a record as one line of JSON: time, level, logger, message, and the fields of `extra`."""

    def format(self, record: logging.LogRecord) -> str:
        line: dict[str, object] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        line |= {name: value for name, value in vars(record).items() if name not in _PLAIN_FIELDS}
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str, ensure_ascii=False)


def configure_logs(level: str) -> None:
    """Send all logs of this process, including the server's, to standard output as JSON lines.

    The encoding is UTF-8 in any locale. A single surrogate has no UTF-8 form; it is written as a JSON escape.
    """
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(encoding="utf-8", errors="backslashreplace")
    handler = logging.StreamHandler(sys.stdout)
    handler.setFormatter(JsonFormatter())
    logging.basicConfig(level=level, handlers=[handler], force=True)
    for library in ("procrastinate", "alembic"):  # they log every step
        logging.getLogger(library).setLevel(logging.WARNING)


def request_id_of(headers: Headers) -> str:
    """The client's request id if it is short and has safe characters only, else a new one."""
    offered = headers.get(HEADER, "")
    return offered if _GOOD_REQUEST_ID.fullmatch(offered) else uuid.uuid4().hex


def trace_of(headers: Headers) -> dict[str, str]:
    """The client's `traceparent` (W3C Trace Context) as a field of log lines; none if it has another form."""
    offered = headers.get(TRACE_HEADER, "")
    return {TRACE_HEADER: offered} if _TRACE.fullmatch(offered) else {}


class RequestLog:
    """Middleware: gives each request an id, returns it in the response, and logs and counts the request."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request_id = request_id_of(Headers(scope=scope))
        state = scope.setdefault("state", {})
        state["request_id"] = request_id
        begin = time.perf_counter()
        status, seconds, sent_bytes = 499, None, 0

        async def send_with_id(message: Message) -> None:
            nonlocal status, seconds, sent_bytes
            if message["type"] == "http.response.start":
                status, seconds = message["status"], time.perf_counter() - begin
                MutableHeaders(scope=message)[HEADER] = request_id
            else:
                sent_bytes += len(message.get("body", b""))
            await send(message)

        try:
            await self.app(scope, receive, send_with_id)
        finally:
            if seconds is None:
                seconds = time.perf_counter() - begin
            self.metrics.observe_request(scope["method"], scope["path"], status, seconds)
            log.info(
                "request",
                extra={
                    "request_id": request_id,
                    "method": scope["method"],
                    "path": scope["path"],
                    "status": status,
                    "code": state.get("problem_code"),
                    "duration_ms": round(seconds * 1000, 1),
                    "sent_bytes": sent_bytes,
                    "client": scope["client"][0] if scope.get("client") else None,
                    **trace_of(Headers(scope=scope)),
                },
            )
