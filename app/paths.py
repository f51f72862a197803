"""URL templates of routes, and which of them a path is of."""

from collections.abc import Iterable

from starlette.routing import compile_path


class PathTemplates:
    """The templates of one app, like `/layout/models/{name}`; a path is of one of them or of none."""

    def __init__(self, templates: Iterable[str]) -> None:
        templates = frozenset(templates)
        self._fixed = frozenset(template for template in templates if "{" not in template)
        self._patterns = [(compile_path(template)[0], template) for template in templates - self._fixed]

    def match(self, path: str) -> str | None:
        """The template that `path` is of."""
        if path in self._fixed:
            return path
        return next((template for pattern, template in self._patterns if pattern.match(path)), None)
