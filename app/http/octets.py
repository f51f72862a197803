"""Files for clients that know them as bytes: their generators leave out answers of any other media type."""

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

OCTETS = "application/octet-stream"
_FILES = ("image/", "application/pdf", "application/zip")


class Octets:
    """Who accepts `application/octet-stream` and nothing else gets a file under this type."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request of `scope`."""
        wants = scope["type"] == "http" and Headers(scope=scope).get("accept") == OCTETS
        await self._app(scope, receive, _as_octets(send) if wants else send)


def _as_octets(send: Send) -> Send:
    async def changed(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(raw=message["headers"])
            if headers.get("content-type", "").startswith(_FILES):
                headers["content-type"] = OCTETS
        await send(message)

    return changed
