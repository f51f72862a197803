"""Headers that the routes of layout models have in common."""

from typing import Annotated

from fastapi import Header
from pydantic import Field

from app.schemas.options import Absent
from models.records import MAX_NAME

IfMatch = Annotated[
    str | Absent, Header(description="The model's ETag: write only if it still has this version; else 412.")
]
IfNoneMatch = Annotated[
    str | Absent,
    Header(
        description="*: write only if no such model exists; else 412.",
        json_schema_extra={"enum": ["*"]},
    ),
]

IdempotencyKey = Annotated[
    Annotated[str, Field(min_length=1, max_length=MAX_NAME)] | Absent,
    Header(
        description="Repeated requests with the same key count once. So do requests with the same body and no key.",
    ),
]

ETAG = {"ETag": {"description": "The version in quotes; for If-Match.", "schema": {"type": "string"}}}
LOCATION = {"Location": {"description": "Path of the new resource.", "schema": {"type": "string"}}}
