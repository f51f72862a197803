"""Path templates of routes, and the template that matches a path."""

from collections.abc import Iterable

from starlette.routing import compile_path


class PathTemplates:
    """The path templates of one app, for example `/layout/models/{name}`. At most one matches a path."""

    def __init__(self, templates: Iterable[str]) -> None:
        templates = frozenset(templates)
        self._fixed = frozenset(template for template in templates if "{" not in template)
        self._patterns = [(compile_path(template)[0], template) for template in templates - self._fixed]

    def match(self, path: str) -> str | None:
        """The template that matches `path`; None if there is none."""
        if path in self._fixed:
            return path
        return next((template for pattern, template in self._patterns if pattern.match(path)), None)
