"""Checks that a request has known form parts and query options only, each as often as expected."""

import types
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from fastapi import Depends, Request
from fastapi.routing import APIRoute
from pydantic import BaseModel
from starlette.datastructures import UploadFile

from app.http.form_parts import LONGEST_NAME
from app.http.paths import PathTemplates
from services.errors import InvalidOption

Form = TypeVar("Form", bound=BaseModel)


def known_parts(model: type[BaseModel]) -> Any:
    """Dependency of a route: the form has only parts that `model` has, and each of them once unless it is a list."""
    kinds = {name: set(_kinds(field.annotation)) for name, field in model.model_fields.items()}
    files = [name for name, kind in kinds.items() if UploadFile in kind]
    needs_file = any(model.model_fields[name].is_required() for name in files)

    async def check(request: Request) -> None:
        form = await request.form()  # already parsed, before the route's dependencies
        if needs_file and not any(isinstance(part, UploadFile) for part in form.values()):
            return  # not multipart/form-data, or no file at all; validation says what is missing
        counts = Counter(name for name, _ in form.multi_items())
        for name, part in form.multi_items():
            shown = name[:LONGEST_NAME]
            is_file = isinstance(part, UploadFile)
            if name not in kinds:
                raise InvalidOption(f"{shown}: {_advice(name, is_file, files, list(kinds))}", shown)
            if counts[name] > 1 and list not in kinds[name]:
                raise InvalidOption(f"{name}: this part was sent {counts[name]} times; send it once.", name)
            if is_file and UploadFile not in kinds[name]:
                raise InvalidOption(f"{name}: this option is a text field; send it without a filename.", name)

    return Depends(check)


def _kinds(annotation: Any) -> Iterator[type]:
    """The types that an annotation is made of: `list[UploadFile] | None` gives list, UploadFile, NoneType."""
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from _kinds(get_args(annotation)[0])
    elif origin in (Union, types.UnionType, list):
        if origin is list:
            yield list
        for argument in get_args(annotation):
            yield from _kinds(argument)
    elif isinstance(annotation, type):
        yield UploadFile if issubclass(annotation, UploadFile) else annotation


def _advice(name: str, is_file: bool, files: list[str], names: list[str]) -> str:
    """What to do about an unknown part."""
    if is_file:
        return f"there is no such file part; send the file as `{'` or `'.join(files)}`."
    return no_such_option(name, names, [name for name in names if name not in files])


def no_such_option(name: str, names: Sequence[str], listed: Sequence[str] | None = None) -> str:
    """That an option is unknown, with the one of `names` that is meant, or all that are `listed` (None: all)."""
    similar = get_close_matches(name[:LONGEST_NAME], names, 1)
    if similar:
        return f"there is no such option; did you mean `{similar[0]}`?"
    return f"there is no such option. The options are {', '.join(names if listed is None else listed)}."


def with_format(form: Form, format: str | None) -> Form:
    """The form with the `format` of the query.

    Raises
    ------
    InvalidOption
        When the form has another format.
    """
    asked: str | None = getattr(form, "format", None)
    if format is None or format == asked:
        return form
    if asked is not None:
        raise InvalidOption(
            f"format: the query has {format}, the form has {asked}; send one of them.", "format"
        )
    return form.model_copy(update={"format": format})


class KnownQueryOptions:
    """Dependency of all routes: a request has only query options that its route has, each of them once.

    No value has the character NUL, which no database of PostgreSQL holds.
    """

    def __init__(self, routes: Iterable[APIRoute]) -> None:
        self._options: dict[tuple[str, str], list[str]] = {}
        for route in routes:
            names = [parameter.alias for parameter in route.dependant.query_params]
            self._options |= {(method, route.path): names for method in route.methods or ()}
        self._templates = PathTemplates(template for _, template in self._options)

    def __call__(self, request: Request) -> None:
        """Check the query of `request`.

        Raises
        ------
        InvalidOption
        """
        template = self._templates.match(request.scope["path"])
        known = self._options.get((request.method, template or ""))
        if known is None:
            return
        counts = Counter(name for name, _ in request.query_params.multi_items())
        for name, count in counts.items():
            shown = name[:LONGEST_NAME]
            if name not in known:
                other = (
                    f"The query options of this path are: {', '.join(known)}."
                    if known
                    else ("This path has no query options.")
                )
                where = " Send options as parts of the form." if request.method == "POST" else ""
                raise InvalidOption(f"{shown}: there is no such query option. {other}{where}", shown)
            if count > 1:
                raise InvalidOption(
                    f"{shown}: this query option was sent {count} times; send it once.", shown
                )
            if "\0" in request.query_params[name]:
                raise InvalidOption(f"{shown}: the value has the character NUL; leave it out.", shown)
