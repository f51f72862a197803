"""The list of changes: who changed models or what was stored, and when."""

from collections.abc import Mapping

from starlette.routing import compile_path
from starlette.types import ASGIApp, Receive, Scope, Send

from models.repository import Author, changes_by

ACTIONS: Mapping[tuple[str, str], str] = {
    ("POST", "/layout/results/{id}/feedback"): "feedback",
    ("DELETE", "/layout/results/{id}/feedback"): "feedback taken back",
    ("DELETE", "/layout/results/{id}"): "result deleted",
    ("DELETE", "/layout/unknown-pages/{id}"): "unknown page deleted",
    ("PUT", "/layout/models/{name}"): "import",
    ("POST", "/layout/import"): "import",
    ("DELETE", "/layout/models/{name}"): "model deleted",
    ("POST", "/layout/models/{name}/initialize"): "initialization",
    ("POST", "/layout/models/{name}/train"): "training",
    ("POST", "/layout/models/{name}/rollback"): "rollback",
    ("PATCH", "/layout/models/{name}/settings"): "settings",
    ("POST", "/layout/models/{name}/samples"): "sample added",
    ("POST", "/layout/models/{name}/samples/archive"): "sample added",
    ("DELETE", "/layout/models/{name}/samples/{id}"): "sample deleted",
}
"""The action of every request whose changes are listed."""


class Audit:
    """Middleware: what the requests of `ACTIONS` change is listed, with the name of the request's key.

    The store writes the entries, each in the transaction that makes the change.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app
        self._patterns = [
            (method, compile_path(template)[0], action) for (method, template), action in ACTIONS.items()
        ]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        action = self._action_of(scope) if scope["type"] == "http" else None
        if action is None:
            await self.app(scope, receive, send)
            return
        with changes_by(Author(scope["state"]["caller"], action)):
            await self.app(scope, receive, send)

    def _action_of(self, scope: Scope) -> str | None:
        for method, pattern, action in self._patterns:
            if method == scope["method"] and pattern.fullmatch(scope["path"]):
                return action
        return None
