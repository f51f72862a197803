"""JSON request bodies: reading, validation, and documentation in the OpenAPI document."""

import asyncio
import json
import re
from typing import Any, TypeVar

from fastapi import Request
from pydantic import BaseModel, ValidationError

from app.http.form_parts import LONGEST_NAME
from app.http.known_options import no_such_option
from services.errors import InvalidOption, TooLarge

Body = TypeVar("Body", bound=BaseModel)
MOST_BYTES = 65_536
"""Default size limit, for a body of a few numbers and names."""
_KIND = re.compile(
    r"(constrained-|function-)\w+.*|(literal|list|tuple|dict|nullable)\[.*\]|int|float|str|bool"
)
"""What pydantic adds to the place of a value that may be of several types."""
_AT_ONCE_BYTES = 8192
"""Longer bodies are read in a thread."""


def json_request(model: type[BaseModel], *, required: bool = True) -> dict[str, Any]:
    """Value of `openapi_extra` for a JSON request body; `app.openapi.document` names it and its parts."""
    schema = model.model_json_schema()
    return {"requestBody": {"required": required, "content": {"application/json": {"schema": schema}}}}


async def read_json(
    request: Request,
    model: type[Body],
    *,
    default: Body | None = None,
    most_bytes: int = MOST_BYTES,
    setting: str | None = None,
) -> Body:
    """The body as a `model`; `default` if the body is empty. `setting` is the name of the limit `most_bytes`, if any.

    Raises
    ------
    TooLarge
        When the body has more than `most_bytes`.
    InvalidOption
        When the body is not JSON or does not match the model; the error names the field.
    """
    body = await request.body()
    if len(body) > most_bytes:
        limit = f"{most_bytes} bytes" + (f" ({setting})" if setting else "")
        raise TooLarge(f"The body is limited to {limit}; this one has {len(body)}.")
    if not body.strip() and default is not None:
        return default
    if len(body) <= _AT_ONCE_BYTES:
        return _parsed(body, model)
    return await asyncio.to_thread(_parsed, body, model)


def _parsed(body: bytes, model: type[Body]) -> Body:
    _check_names(body)
    try:
        return model.model_validate_json(body)
    except ValidationError as error:
        raise _told(error, model) from error


async def refuse_body(request: Request) -> None:
    """Raise if a request without options has a body; an empty object counts as none.

    Raises
    ------
    InvalidOption
    """
    if (await request.body()).strip() not in (b"", b"{}"):
        raise InvalidOption("body: this request has no options; send it without a body.", "body")


def _check_names(body: bytes) -> None:
    """Raise if an object has the same name twice; `json` and pydantic would take the last value.

    Raises
    ------
    InvalidOption
    """

    def check(pairs: list[tuple[str, Any]]) -> None:
        names: set[str] = set()
        for name, _ in pairs:
            shown = ascii(name)[1:-1][:LONGEST_NAME]
            if name in names:
                raise InvalidOption(f"{shown}: this name appears twice in one object; send it once.", shown)
            names.add(name)

    try:
        json.loads(body, object_pairs_hook=check)
    except (ValueError, RecursionError):
        return  # pydantic describes what is wrong


def _told(error: ValidationError, model: type[BaseModel]) -> InvalidOption:
    """Error of the first problem in the body; a name that does not exist comes before one that is missing."""
    problems = error.errors(include_url=False, include_context=False)
    first = next((each for each in problems if each["type"] == "extra_forbidden"), problems[0])
    # Which of several types was tried is no place.
    place = [part for index, part in enumerate(first["loc"]) if not index or not _KIND.fullmatch(str(part))]
    steps = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place)
    field = steps.removeprefix(".")[:LONGEST_NAME] or "body"
    if first["type"] == "extra_forbidden":
        names = _names_of(model, is_nested=len(first["loc"]) > 1)
        return InvalidOption(f"{field}: {no_such_option(str(first['loc'][-1]), names)}", field)
    if first["type"] == "missing":
        return InvalidOption(f"{field}: it is missing.", field)
    if first["type"] == "json_invalid":
        return InvalidOption("body: the body is not valid JSON.", field)
    reason = str(first["msg"]).removeprefix("Value error, ")
    if not first["loc"]:
        return InvalidOption(f"body: {reason}.", field)
    shown = ascii(first["input"])
    shown = shown if len(shown) <= LONGEST_NAME else shown[: LONGEST_NAME - 3] + "..."
    return InvalidOption(f"{field}: {reason}; got {shown}.", field)


def _names_of(model: type[BaseModel], *, is_nested: bool) -> list[str]:
    """The names that a body may have; those of the objects in it if the unknown one is in one of them."""
    schema = model.model_json_schema()
    objects = schema.get("$defs", {}).values() if is_nested else [schema]
    return list(dict.fromkeys(name for each in objects for name in each.get("properties", {})))
