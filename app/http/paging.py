"""Lists in parts: `limit`, `cursor`, and a `Link` header with the address of the next part."""

from collections.abc import Iterable
from itertools import islice
from typing import Annotated, TypeVar
from urllib.parse import urlencode

from fastapi import Query, Request, Response

from app.schemas.options import Absent, Written
from app.state import AppState

T = TypeVar("T")
MOST_LISTED = 1000
OF_LINK = "the cursor of the header `Link` of the previous part"
"""What is expected of a cursor."""

Limit = Annotated[int, Query(ge=1, le=MOST_LISTED, description="Largest number of entries in the response.")]
Cursor = Annotated[
    Annotated[str, Written("^[A-Za-z0-9._-]{1,60}$", OF_LINK)] | Absent,
    Query(
        description="Where the list continues, from the `Link` header of the previous part. An entry that was deleted "
        "since does no harm."
    ),
]
LINK = {
    "Link": {
        "description": 'Path of the next part, as `<path>; rel="next"`; absent in the last part.',
        "schema": {"type": "string"},
    }
}


def first_of(entries: Iterable[T], limit: int) -> tuple[list[T], bool]:
    """The first `limit` entries, and whether there are more."""
    found = list(islice(entries, limit + 1))
    return found[:limit], len(found) > limit


def link_next(request: Request, state: AppState, response: Response, cursor: str | int) -> None:
    """Add the header that leads to the entries after `cursor`, with the other query options of the request."""
    query = [(name, value) for name, value in request.query_params.multi_items() if name not in _OWN]
    path = f"{state.settings.root_path}{request.scope['path']}?{urlencode([*query, ('cursor', cursor)])}"
    response.headers["Link"] = f'<{path}>; rel="next"'


_OWN = {"cursor", "token"}
"""A token is short-lived and must not stay in lists of links."""
