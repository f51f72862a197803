"""API keys, checked before a body is read."""

import hmac
from collections.abc import Collection
from contextlib import suppress

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from services.errors import DocumentError

HEADER = "X-API-Key"
OPEN_PATHS = frozenset({"/health/live", "/health/ready", "/metrics", "/docs", "/openapi.json"})
"""Paths that probes, scrapers and readers of the documentation use. None of them shows a caller's data."""


class Unauthorized(DocumentError):
    """The request has no API key."""

    code = "unauthorized"


class Forbidden(DocumentError):
    """The request's API key is not valid."""

    code = "forbidden"


class ApiKeys:
    """Middleware: a request without a valid key reaches only `OPEN_PATHS`. Without configured keys all are open."""

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
        offered = key.encode("latin-1")  # the bytes that were sent: Starlette decodes headers as Latin-1
        # Every key is compared in constant time, so that the response time reveals nothing about a key.
        if not max(hmac.compare_digest(offered, good) for good in self.keys):
            raise Forbidden(f"The API key in the {HEADER} header is not valid.")


def _bytes_of(key: str) -> set[bytes]:
    """The bytes that clients may send for a key: UTF-8 (curl), or Latin-1 if it can encode the key (browsers)."""
    forms = {key.encode("utf-8", "surrogateescape")}
    with suppress(UnicodeEncodeError):
        forms.add(key.encode("latin-1"))
    return forms
