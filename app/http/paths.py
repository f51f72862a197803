"""Path templates of routes, the template that matches a path, and paths that name nothing."""

import re
from collections.abc import Iterable

from starlette.routing import compile_path
from starlette.types import ASGIApp, Receive, Scope, Send

from services.errors import DocumentError

RECTIFY_PATHS = ("/rectify", "/rectify/image", "/rectify/pdf", "/rectify/text", "/rectify/pages")
MOSAIC_PATHS = ("/mosaic", "/mosaic/image", "/mosaic/pdf", "/mosaic/json")
"""Each with the same operation under it, with one type of answer."""
UPLOAD_PATHS = ("/uploads", "/uploads/{id}")
_CONTROL_CHARACTER = re.compile("[\x00-\x1f\x7f]")


class PathTemplates:
    """The path templates of one app, for example `/layout/models/{name}`.

    Of templates that match the same path, the one with the fewest parameters is the path's: `samples/archive` is no
    sample with the id `archive`.
    """

    def __init__(self, templates: Iterable[str]) -> None:
        templates = frozenset(templates)
        self._fixed = frozenset(template for template in templates if "{" not in template)
        parametrized = sorted(templates - self._fixed, key=lambda template: (template.count("{"), template))
        self._patterns = [(compile_path(template)[0], template) for template in parametrized]

    def match(self, path: str) -> str | None:
        """The template that matches `path`; None if there is none."""
        if path in self._fixed:
            return path
        return next((template for pattern, template in self._patterns if pattern.fullmatch(path)), None)


class NothingNamed(DocumentError):
    """No resource can have this path."""

    code = "not-found"


class PlainPaths:
    """Middleware: a path with a control character names nothing, whoever asks.

    Routes are patterns that end with `$`, which also matches before a last newline: `/audit%0a` would get the answer of
    `/audit`, past all rules that compare paths. NUL is in no text of PostgreSQL.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and _CONTROL_CHARACTER.search(scope["path"]):
            raise NothingNamed("The path has a control character, so it names nothing.")
        await self.app(scope, receive, send)
