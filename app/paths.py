"""Path templates of routes, and the template that matches a path."""

from collections.abc import Iterable

from starlette.routing import compile_path


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
        return next((template for pattern, template in self._patterns if pattern.match(path)), None)
