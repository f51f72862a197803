"""The list of changes: who changed models or what was stored, and when."""

import logging
from collections.abc import Mapping

from starlette.datastructures import Headers
from starlette.routing import compile_path
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.key_names import name_of_key
from app.layout_store import LayoutStore
from models.errors import StoreError

log = logging.getLogger(__name__)

ACTIONS: Mapping[tuple[str, str], str] = {
    ("POST", "/layout/results/{id}/feedback"): "feedback",
    ("DELETE", "/layout/results/{id}/feedback"): "feedback taken back",
    ("DELETE", "/layout/results/{id}"): "result deleted",
    ("DELETE", "/layout/unknown-pages/{id}"): "unknown page deleted",
    ("PUT", "/layout/models/{name}"): "import",
    ("DELETE", "/layout/models/{name}"): "model deleted",
    ("POST", "/layout/models/{name}/initialize"): "initialization",
    ("POST", "/layout/models/{name}/train"): "training",
    ("POST", "/layout/models/{name}/rollback"): "rollback",
    ("PATCH", "/layout/models/{name}/settings"): "settings",
    ("POST", "/layout/models/{name}/samples"): "sample added",
    ("DELETE", "/layout/models/{name}/samples/{id}"): "sample deleted",
}
"""The action of every request that is listed."""
CHANGED_MODELS = "changed_models"
"""Entry of a request's state: names of the models that a request without a model in its path has changed."""


class Audit:
    """Middleware: lists every request of `ACTIONS` that succeeds, before its response is sent."""

    def __init__(self, app: ASGIApp, store: LayoutStore) -> None:
        self.app = app
        self.store = store
        self._patterns = [
            (method, compile_path(template)[0], action) for (method, template), action in ACTIONS.items()
        ]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        found = self._action_of(scope) if scope["type"] == "http" else None
        if found is None:
            await self.app(scope, receive, send)
            return
        action, parts = found

        async def send_when_listed(message: Message) -> None:
            if message["type"] == "http.response.start" and message["status"] < 300:
                await self._note(scope, action, parts, Headers(raw=message["headers"]))
            await send(message)

        await self.app(scope, receive, send_when_listed)

    def _action_of(self, scope: Scope) -> tuple[str, dict[str, str]] | None:
        for method, pattern, action in self._patterns:
            match = pattern.match(scope["path"]) if method == scope["method"] else None
            if match:
                return action, match.groupdict()
        return None

    async def _note(self, scope: Scope, action: str, parts: Mapping[str, str], headers: Headers) -> None:
        state = scope.get("state", {})
        key = state.get("api_key")
        who = None if key is None else name_of_key(key)
        tag = headers.get("etag", "").strip('"')
        detail = f"version {tag}" if tag.isdigit() else parts.get("id", "")[:100]
        models = [parts["name"]] if "name" in parts else state.get(CHANGED_MODELS) or [None]
        try:
            for model in models:
                await self.store.call(
                    lambda store, model=model: store.note_change(who, action, model, detail)  # type: ignore[misc]
                )
        except StoreError as error:
            log.error("a change could not be listed: %s: %s", action, error.detail)
