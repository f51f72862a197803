"""The check of API keys and tokens, before a body is read."""

from collections.abc import Mapping
from urllib.parse import parse_qsl, urlencode

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from app.access.keyring import Keyring
from app.access.known_keys import each_key
from app.access.tokens import Tokens
from app.roles import ADMIN, Key, digest_of_key
from services.errors import DocumentError

HEADER = "X-API-Key"
TOKEN_OPTION = "token"
"""Query option of a GET request that holds a token."""
OPEN_PATHS = frozenset(
    {"/", "/service-worker.js", "/health/live", "/health/ready", "/metrics", "/docs", "/openapi.json"}
)
"""Paths that probes, scrapers and readers of the documentation use. None of them shows a caller's data."""
OPEN_FOLDERS = ("/docs/", "/static/")
"""Scripts and styles of the documentation, and of the page at `/`."""


class Unauthorized(DocumentError):
    """The request has no API key."""

    code = "unauthorized"


class Forbidden(DocumentError):
    """The request's API key is not valid."""

    code = "forbidden"


class ApiKeys:
    """Middleware: a request without a valid key reaches only open paths. Without configured keys all are open.

    A request has its key in X-API-Key or as `Authorization: Bearer`. A GET request may have a token of
    `POST /tokens` as a query option instead, because a browser sends no headers for images and EventSource.
    `request.state.key` is the key that was sent, `caller` its name, `role` its role. Without configured keys
    there is no key and no caller, and the role is admin.
    """

    def __init__(self, app: ASGIApp, keyring: Keyring, tokens: Tokens) -> None:
        self.app = app
        self.keyring = keyring
        self.tokens = tokens

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        token = None
        if scope["method"] in ("GET", "HEAD"):
            token, query = _without_token(scope["query_string"])
            scope = {**scope, "query_string": query}
        keys = self.keyring.keys
        state = scope.setdefault("state", {})
        state |= {"key": None, "caller": None, "role": None if keys else ADMIN}
        is_open = scope["path"] in OPEN_PATHS or scope["path"].startswith(OPEN_FOLDERS)
        if keys and not is_open:
            key = self._judge(Headers(scope=scope), token, keys)
            state |= {"key": key, "caller": key.name, "role": key.role}
        await self.app(scope, receive, send)

    def _judge(self, headers: Headers, token: str | None, keys: Mapping[str, Key]) -> Key:
        """The key that the request was sent with."""
        sent = [*_values(headers, HEADER), *filter(None, map(_bearer, _values(headers, "Authorization")))]
        if len(set(sent)) > 1:
            raise Forbidden(f"{HEADER} and Authorization hold different keys; send one of them.")
        if sent:
            # Starlette decodes headers as Latin-1: these are the bytes that were sent. Nobody can choose the digest of
            # what he sends, so that the time of the search reveals nothing about a key.
            known = keys.get(digest_of_key(sent[0].encode("latin-1")))
            if known is None:
                raise Forbidden(f"The API key in the {HEADER} or Authorization header is not valid.")
            return known
        if token:
            return self.tokens.key_of(token, each_key(keys))
        raise Unauthorized(
            f"Send an API key in the {HEADER} header, or as Authorization: Bearer KEY. A link to read something may "
            f"have a token of POST /tokens as the query option `{TOKEN_OPTION}`."
        )


def _values(headers: Headers, name: str) -> set[str]:
    """The value of a header, if it has one.

    Raises
    ------
    Forbidden
        When the header came several times, with different values: a proxy may have judged another one.
    """
    values = set(filter(None, headers.getlist(name)))
    if len(values) > 1:
        raise Forbidden(f"The header {name} came several times, with different values; send it once.")
    return values


def _bearer(authorization: str) -> str | None:
    """Key of an Authorization header; None if it has another scheme, as that of a proxy in front may have."""
    scheme, _, key = authorization.strip().partition(" ")
    return key.strip() if scheme.lower() == "bearer" else None


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
