"""Bodies of requests that are JSON: read, checked, and told of in the OpenAPI document."""

from typing import Any, TypeVar

from fastapi import Request
from pydantic import BaseModel, ValidationError

from services.errors import InvalidOption, TooLarge

Body = TypeVar("Body", bound=BaseModel)
MOST_BYTES = 65_536
"""Of a body that holds a few numbers and names."""
_LONGEST_FIELD = 80


def json_request(model: type[BaseModel], *, required: bool = True) -> dict[str, Any]:
    """The request's body for `openapi_extra`; `model` refers to no other."""
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
    """The body as a `model`; `default` when there is none. `setting` is what `most_bytes` comes from, if anything.

    Raises
    ------
    TooLarge
        When it has more than `most_bytes`.
    InvalidOption
        When it is no JSON, or not what is expected; the field is named.
    """
    body = await request.body()
    if len(body) > most_bytes:
        limit = f"{most_bytes} bytes" + (f" ({setting})" if setting else "")
        raise TooLarge(f"The body is limited to {limit}; this one has {len(body)}.")
    if not body.strip() and default is not None:
        return default
    try:
        return model.model_validate_json(body)
    except ValidationError as error:
        raise _told(error) from error


def _told(error: ValidationError) -> InvalidOption:
    """The first thing that is wrong."""
    first = error.errors(include_url=False, include_context=False)[0]
    field = ".".join(map(str, first["loc"]))[:_LONGEST_FIELD] or "body"
    if first["type"] == "extra_forbidden":
        return InvalidOption(f"{field}: there is no such option.", field)
    if first["type"] == "missing":
        return InvalidOption(f"{field}: it is missing.", field)
    if first["type"] == "json_invalid":
        return InvalidOption("body: this is not JSON.", field)
    reason = str(first["msg"]).removeprefix("Value error, ")
    if not first["loc"]:
        return InvalidOption(f"body: {reason}.", field)
    shown = ascii(first["input"])
    shown = shown if len(shown) <= _LONGEST_FIELD else shown[: _LONGEST_FIELD - 3] + "..."
    return InvalidOption(f"{field}: {reason}; got {shown}.", field)
