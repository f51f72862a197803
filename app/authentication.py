"""API keys, judged before a body is read."""

import hmac
from collections.abc import Collection
from contextlib import suppress

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from services.errors import DocumentError

HEADER = "X-API-Key"
OPEN_PATHS = frozenset({"/health/live", "/health/ready", "/metrics", "/docs", "/openapi.json"})
"""What probes, scrapers and readers of the documentation need; none of it shows a caller's data."""


class Unauthorized(DocumentError):
    """The request has no API key."""

    code = "unauthorized"


class Forbidden(DocumentError):
    """The request's API key is not a good one."""

    code = "forbidden"


class ApiKeys:
    """Middleware: without a good key, only `OPEN_PATHS`; with no keys configured, everything."""

    def __init__(self, app: ASGIApp, keys: Collection[str]) -> None:
        self.app = app
        self.keys = tuple(form for key in keys for form in _bytes_of(key))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and self.keys and scope["path"] not in OPEN_PATHS:
            self._judge(Headers(scope=scope).get(HEADER))
        await self.app(scope, receive, send)

    def _judge(self, key: str | None) -> None:
        if not key:
            raise Unauthorized(f"Send an API key in the {HEADER} header.")
        offered = key.encode("latin-1")  # the bytes that came: headers are decoded so
        # All are compared, each in constant time, so that the answer's delay tells nothing of a key.
        if not max(hmac.compare_digest(offered, good) for good in self.keys):
            raise Forbidden(f"The API key in the {HEADER} header is not a good one.")


def _bytes_of(key: str) -> set[bytes]:
    """The bytes by which clients may send a key: UTF-8 (curl), or Latin-1 where that can write it (browsers)."""
    forms = {key.encode("utf-8", "surrogateescape")}
    with suppress(UnicodeEncodeError):
        forms.add(key.encode("latin-1"))
    return forms
