"""The headers that the routes of layout models share."""

from typing import Annotated, Any

from fastapi import Header
from pydantic import Field

from app.schemas.options import Absent

IfMatch = Annotated[
    str | Absent, Header(description="The model's ETag: write only if it still has that version; else 412.")
]
IfNoneMatch = Annotated[
    str | Absent,
    Header(
        description="*: write only if there is no such model yet; else 412.",
        json_schema_extra={"enum": ["*"]},
    ),
]

IdempotencyKey = Annotated[
    Annotated[str, Field(min_length=1, max_length=200)] | Absent,
    Header(
        description="The same key counts once, however often the request is sent. So does the same body without a key.",
    ),
]

ETAG: dict[str, Any] = {
    "ETag": {"description": "The version, quoted; for If-Match.", "schema": {"type": "string"}}
}
LOCATION: dict[str, Any] = {"Location": {"description": "Its path.", "schema": {"type": "string"}}}
