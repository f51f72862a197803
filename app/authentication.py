"""API keys and short-lived tokens, checked before a body is read."""

import base64
import hmac
import struct
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from types import MappingProxyType
from urllib.parse import parse_qsl, urlencode

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from app.key_names import name_of_key, spellings_of_key
from app.roles import FileKey, digest_of_key
from services.errors import DocumentError

HEADER = "X-API-Key"
TOKEN_OPTION = "token"
"""Query option of a GET request that holds a token."""
OPEN_PATHS = frozenset({"/", "/health/live", "/health/ready", "/metrics", "/docs", "/openapi.json"})
"""Paths that probes, scrapers and readers of the documentation use. None of them shows a caller's data."""
OPEN_FOLDERS = ("/docs/", "/static/")
"""Scripts and styles of the documentation, and of the page at `/`."""
_PURPOSE = b"document-rectification token 1"
_MAC_BYTES = 16


class Unauthorized(DocumentError):
    """The request has no API key."""

    code = "unauthorized"


class Forbidden(DocumentError):
    """The request's API key or token is not valid."""

    code = "forbidden"


class ApiKeys:
    """Middleware: a request without a valid key reaches only open paths. Without configured keys all are open.

    A request has its key in X-API-Key or as `Authorization: Bearer`. A GET request may have a token of
    `make_token` as a query option instead, because a browser sends no headers for images and EventSource.
    `request.state.api_key` is the configured key that was sent; None: no keys are configured, or the path is open.
    `request.state.caller` is its name.
    """

    def __init__(
        self,
        app: ASGIApp,
        keys: Collection[str],
        clock: Callable[[], float] = time.time,
        file_keys: Mapping[str, FileKey] = MappingProxyType({}),
    ) -> None:
        """`file_keys` are those of API_KEYS_FILE, by their digests."""
        self.app = app
        self.file_keys = file_keys
        # In the place of the key itself, which is not known; its digest is secret too, so it can sign tokens.
        self.entries = {digest: f"{key.name}:sha256:{digest}" for digest, key in file_keys.items()}
        self.roles = {self.entries[digest]: key.role for digest, key in file_keys.items()}
        self.keys = {
            form: key for key in keys for spelled in spellings_of_key(key) for form in _bytes_of(spelled)
        }
        self.clock = clock

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        token = None
        if scope["method"] in ("GET", "HEAD"):
            token, query = _without_token(scope["query_string"])
            scope = {**scope, "query_string": query}
        state = scope.setdefault("state", {})
        state["api_key"] = state["caller"] = None
        is_open = scope["path"] in OPEN_PATHS or scope["path"].startswith(OPEN_FOLDERS)
        if (self.keys or self.entries) and not is_open:
            state["api_key"] = key = self._judge(Headers(scope=scope), token)
            state["caller"] = name_of_key(key)
            state["role"] = self.roles.get(key)
        await self.app(scope, receive, send)

    def _judge(self, headers: Headers, token: str | None) -> str:
        """The configured key that the request was sent with."""
        sent = [key for key in (headers.get(HEADER), _bearer(headers.get("authorization"))) if key]
        if len(set(sent)) > 1:
            raise Forbidden(f"{HEADER} and Authorization hold different keys; send one of them.")
        if sent:
            return self._known_key(sent[0])
        if token:
            return key_of_token(token, sorted({*self.keys.values(), *self.entries.values()}), self.clock())
        raise Unauthorized(
            f"Send an API key in the {HEADER} header, or as Authorization: Bearer KEY. A link to read something may "
            f"have a token of POST /tokens as the query option `{TOKEN_OPTION}`."
        )

    def _known_key(self, key: str) -> str:
        offered = key.encode("latin-1")  # the bytes that were sent: Starlette decodes headers as Latin-1
        # Every key is compared in constant time, so that the response time reveals nothing about a key.
        found = [known for form, known in self.keys.items() if hmac.compare_digest(offered, form)]
        found += [
            entry
            for digest, entry in self.entries.items()
            if hmac.compare_digest(digest_of_key(offered), digest)
        ]
        if not found:
            raise Forbidden(f"The API key in the {HEADER} or Authorization header is not valid.")
        return found[0]


def make_token(key: str, expires_s: int) -> str:
    """Token that allows to read with `key` until `expires_s` (seconds since 1970); it does not contain the key.

    The key itself signs the token, so all services with the same keys accept it.
    """
    body = struct.pack(">Q", expires_s)
    return base64.urlsafe_b64encode(body + _signature(key, body)).decode("ascii").rstrip("=")


def key_of_token(token: str, keys: Sequence[str], now_s: float) -> str:
    """The key that signed `token`.

    Raises
    ------
    Forbidden
        When none of the keys did, or the token has expired.
    """
    data = b""
    with suppress(ValueError):
        data = base64.urlsafe_b64decode(token.encode("ascii", "replace") + b"=" * (-len(token) % 4))
    body, signature = data[:8], data[8:]
    signers = [key for key in keys if hmac.compare_digest(_signature(key, body), signature)]
    if len(body) != 8 or not signers:
        raise Forbidden("The token is not valid. Get a new one with POST /tokens.")
    if struct.unpack(">Q", body)[0] <= now_s:
        raise Forbidden("The token has expired. Get a new one with POST /tokens.")
    return signers[0]


def _signature(key: str, body: bytes) -> bytes:
    return hmac.digest(key.encode("utf-8", "surrogateescape"), _PURPOSE + body, "sha256")[:_MAC_BYTES]


def _bearer(authorization: str | None) -> str | None:
    """Key of an Authorization header.

    Raises
    ------
    Unauthorized
        When the header has another scheme.
    """
    if not authorization:
        return None
    scheme, _, key = authorization.strip().partition(" ")
    if scheme.lower() != "bearer":
        raise Unauthorized(f"Send the API key as Authorization: Bearer KEY, or in the {HEADER} header.")
    return key.strip()


def _without_token(query: bytes) -> tuple[str | None, bytes]:
    """The token in a query string, and the query string without it."""
    if TOKEN_OPTION.encode() not in query:
        return None, query
    pairs = parse_qsl(query.decode("latin-1"), keep_blank_values=True)
    tokens = [value for name, value in pairs if name == TOKEN_OPTION]
    if not tokens:
        return None, query
    rest = urlencode([(name, value) for name, value in pairs if name != TOKEN_OPTION])
    return tokens[0], rest.encode("ascii")


def _bytes_of(key: str) -> set[bytes]:
    """The bytes that clients may send for a key: UTF-8 (curl), or Latin-1 if it can encode the key (browsers)."""
    forms = {key.encode("utf-8", "surrogateescape")}
    with suppress(UnicodeEncodeError):
        forms.add(key.encode("latin-1"))
    return forms
