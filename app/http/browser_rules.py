"""What browsers may do with this service: security headers of all responses, and no writing from other sites."""

from collections.abc import Collection, Mapping

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from services.errors import DocumentError

PAGE = "/"
PAGE_FOLDER = "/static/"
"""Scripts, styles and pictures of the page at `/`."""
SERVICE_WORKER_PATH = "/service-worker.js"
"""The script that shows the page without a network."""
_DOCUMENTATION = "/docs"
_SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
_COMMON = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
}
PAGE_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob: data:",
        "connect-src 'self'",
        "manifest-src 'self'",
        "form-action 'none'",
        "base-uri 'none'",
        "frame-ancestors 'none'",
    )
)
"""Content-Security-Policy of the page: its own files only, no inline script or style. `blob:` and `data:` are pictures
that the page itself has read or received."""
_PAGE = {
    "Content-Security-Policy": PAGE_POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(self), geolocation=(), microphone=()",
    "Cache-Control": "no-cache",
}
_DOCUMENTATION_POLICY = "; ".join(
    (
        "default-src 'self'",
        "script-src 'self'",
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data:",
        "base-uri 'none'",
        "frame-ancestors 'none'",
    )
)
_DATA_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'"
"""Policy of everything else: what is opened as a document of its own runs no script."""
_PDF_POLICY = "frame-ancestors 'none'"
"""Browsers show a PDF by a plug-in of their own, which `default-src 'none'` would switch off."""


class CrossSite(DocumentError):
    """A browser sends a request that changes something for a page of another site."""

    code = "forbidden"


class SecurityHeaders:
    """Middleware: adds the headers by which browsers restrict what a response may do."""

    def __init__(self, app: ASGIApp, *, has_other_origins: bool) -> None:
        self.app = app
        self.has_other_origins = has_other_origins

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in self._headers_of(scope["path"], headers).items():
                    headers.setdefault(name, value)
            await send(message)

        await self.app(scope, receive, send_with_headers)

    def _headers_of(self, path: str, headers: Headers) -> Mapping[str, str]:
        if path in (PAGE, SERVICE_WORKER_PATH) or path.startswith(PAGE_FOLDER):
            return _COMMON | _PAGE
        if path == _DOCUMENTATION or path.startswith(_DOCUMENTATION + "/"):
            return {**_COMMON, "Content-Security-Policy": _DOCUMENTATION_POLICY}
        is_pdf = headers.get("content-type", "").startswith("application/pdf")
        resources = {} if self.has_other_origins else {"Cross-Origin-Resource-Policy": "same-origin"}
        return {**_COMMON, **resources, "Content-Security-Policy": _PDF_POLICY if is_pdf else _DATA_POLICY}


class OwnSite:
    """Middleware: refuses requests of pages of other sites that change something.

    A browser names the site whose page sends a request (`Sec-Fetch-Site`, `Origin`). Without API keys, any site that a
    person visits could otherwise write to a service in the person's own network. Other clients send neither header.
    """

    def __init__(self, app: ASGIApp, origins: Collection[str] = ()) -> None:
        """`origins` are the other origins that may use the service; `*`: all."""
        self.app = app
        self.origins = frozenset(origins)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        is_writing = scope["type"] == "http" and scope["method"] not in _SAFE_METHODS
        if is_writing and self._is_of_another_site(Headers(scope=scope)):
            raise CrossSite(
                "This request comes from a page of another site. Name the origin of that page in CORS_ORIGINS to allow "
                "it."
            )
        await self.app(scope, receive, send)

    def _is_of_another_site(self, headers: Headers) -> bool:
        origin = headers.get("origin")
        if "*" in self.origins or (origin is not None and origin in self.origins):
            return False
        site = headers.get("sec-fetch-site")
        if site is not None:
            return site in ("cross-site", "same-site")
        # A proxy may have changed the scheme, so only hosts are compared.
        return origin is not None and origin.partition("://")[2] != headers.get("host", "")
