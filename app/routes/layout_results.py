"""GET /layout/results: the newest results with their values, as JSON, JSON lines or CSV, page by page."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, cast

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from app.access.callers import caller_of
from app.http.paging import LINK, link_next
from app.http.preconditions import Conflict
from app.http.problems import documented
from app.http.representations import choose_described_format
from app.routes.common_responses import STORE
from app.schemas.layout_results import LIST_MEDIA_TYPES, ListFormat, ResultEntry, ResultList
from app.schemas.options import Absent
from app.state import State
from models.records import ListedResult, ResultState, Review, ReviewOrder, ReviewState
from models.repository import Store, cursor_of

router = APIRouter(tags=["layout"])

CURSOR_PATTERN = r"^([0-9]{1,9}(\.[0-9]{1,20})?(e-[0-9]{1,3})?_)?[0-9A-HJKMNP-TV-Z]{26}$"
MOST_LISTED = 200
"""Results of one answer; the documents of 200 pages with all their zones are read in 0.2 s."""
MOST_LISTED_BYTES = 4 << 20
"""Of all that is stored of the results of one answer, as JSON. The last result may reach over it."""
COLUMNS = (
    "result",
    "created",
    "state",
    "class",
    "probability",
    "label",
    "type",
    "value",
    "currency",
    "problem",
    "confidence",
    "text",
)
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""First letters by which spreadsheets take a text as a formula."""


@router.get(
    "/layout/results",
    operation_id="layout_results",
    response_class=Response,
    responses={
        200: {
            "description": "The results. The header `Link` has the address of the next ones.",
            "model": ResultList,
            "content": {
                "text/csv": {"schema": {"type": "string"}},
                "application/jsonl": {"schema": {"type": "string"}},
            },
            "headers": LINK,
        },
        **documented("invalid-option", "not-acceptable", "conflict", *STORE),
    },
)
async def layout_results(
    request: Request,
    state: State,
    limit: Annotated[int, Query(ge=1, le=MOST_LISTED)] = 50,
    cursor: Annotated[
        Annotated[str, Field(pattern=CURSOR_PATTERN)] | Absent,
        Query(description="`next` of the answer before, in the same order; absent: the first ones."),
    ] = None,
    state_: Annotated[
        Literal["open", "confirmed", "corrected", "skipped"] | None,
        Query(alias="state", description="open: no feedback. corrected: feedback found something wrong."),
    ] = None,
    order: Annotated[
        ReviewOrder,
        Query(description="gain: what is expected to teach most first. confidence: the least sure first."),
    ] = "newest",
    format: Annotated[ListFormat | None, Query(description="Or by `Accept`.")] = None,
) -> Response:
    """List the kept results of pages with the values of their fields: the newest first, or as a review queue.

    JSON lines have one result a line, CSV one value a row. A result that is made meanwhile is not in later answers; one
    that expires is left out. Where results are large, an answer has fewer than `limit`; `next` leads on, as does the
    header `Link`. With API keys, the results are those of the caller's key.
    """
    chosen = choose_described_format(format, request.headers.get("accept"), LIST_MEDIA_TYPES)
    owner = caller_of(request).only

    def read(store: Store) -> tuple[Response, str | None]:
        reviews, results, following = _read(store, limit, state_, order, cursor, owner)
        return _listed(results, reviews, chosen, following), following

    response, following = await state.store.read_list(read)
    if following is not None:
        link_next(request, state, response, following)
    return response


def _read(
    store: Store,
    limit: int,
    state: ReviewState | None,
    order: ReviewOrder,
    after: str | None,
    owner: str | None,
) -> tuple[dict[str, Review], list[ListedResult], str | None]:
    """What the queue knows of results, by their ids; the results in their order; the cursor of those that follow.

    Raises
    ------
    Conflict
        When the cursor is that of another order.
    """
    if (order == "newest") == ("_" in (after or "")) and after is not None:
        raise Conflict("cursor: it belongs to a list in another order; begin again without it.", "cursor")
    if order == "newest" and state in (None, "confirmed", "corrected"):
        of_state = None if state is None else cast(ResultState, state)
        results, has_more = _first_of(store.each_result(before=after, owner=owner, state=of_state), limit)
        reviews = store.reviews(limit, ids=[each.id for each in results])
        following = results[-1].id if has_more else None
        return {review.id: review for review in reviews}, results, following
    reviews = store.reviews(limit + 1, state=state, order=order, after=after, owner=owner)
    known = {review.id: review for review in reviews[:limit]}
    # A result that was deleted after the queue was read is left out.
    results, has_more = _first_of(store.each_result_of(known), limit)
    if has_more:
        return known, results, cursor_of(known[results[-1].id], order)
    return known, results, cursor_of(reviews[limit - 1], order) if len(reviews) > limit else None


def _first_of(results: Iterator[ListedResult], limit: int) -> tuple[list[ListedResult], bool]:
    """The first results, with what is listed of them alone, and whether there are more.

    There are `limit` at most, and fewer where their documents have more than `MOST_LISTED_BYTES`.
    """
    found: list[ListedResult] = []
    size = 0
    for each in results:
        if len(found) == limit or size >= MOST_LISTED_BYTES:
            return found, True
        size += each.stored_bytes
        listed: dict[str, Any] = {
            name: each.result[name] for name in ("class", "fields") if name in each.result
        }
        found.append(replace(each, result=listed))
    return found, False


def _listed(
    results: Sequence[ListedResult], reviews: Mapping[str, Review], chosen: ListFormat, following: str | None
) -> Response:
    entries = [_entry(each, reviews.get(each.id)) for each in results]
    if chosen == "csv":
        return Response(_csv(entries), media_type="text/csv")
    if chosen == "jsonl":
        lines = (entry.model_dump_json(by_alias=True) + "\n" for entry in entries)
        return Response("".join(lines), media_type="application/jsonl")
    body = ResultList(results=entries, next=following).model_dump_json(by_alias=True)
    return Response(body, media_type="application/json")


def _entry(listed: ListedResult, review: Review | None) -> ResultEntry:
    result = listed.result
    of_class = result.get("class")
    return ResultEntry.model_validate(
        {
            "id": listed.id,
            "created": listed.created_at,
            "expires": listed.expires_at,
            "state": listed.state if review is None else review.state,
            "review": None if review is None else _facts(review),
            "class": None if of_class is None else of_class["name"],
            "probability": None if of_class is None else of_class["probability"],
            "fields": result.get("fields", []),
        }
    )


def _facts(review: Review) -> dict[str, Any]:
    return {
        "zones": review.zones,
        "confidence": round(review.confidence, 4),
        "gain": round(review.gain, 4),
        "decision": review.decision,
        "has_image": review.has_image,
        "claimed_by": review.claimed_by,
        "claimed_until": review.claimed_until,
    }


def _csv(entries: Sequence[ResultEntry]) -> str:
    """A row for each value, after a row with the names of the columns (RFC 4180)."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS)
    writer.writeheader()
    for entry in entries:
        shared = {
            "result": entry.id,
            "created": entry.created.isoformat(),
            "state": entry.state,
            "class": entry.class_,
            "probability": entry.probability,
        }
        for field in entry.fields:
            values: Mapping[str, Any] = field.model_dump(exclude={"zones"})
            is_read = field.type in ("text", "pattern")
            writer.writerow(
                {
                    **shared,
                    **values,
                    "label": _harmless(field.label),
                    "text": _harmless(field.text),
                    "value": _harmless(field.value) if is_read else field.value,
                }
            )
    return text.getvalue()


def _harmless(text: str | None) -> str | None:
    """A text that no spreadsheet takes as a formula: an apostrophe stands before its first letter if one could."""
    return f"'{text}" if text and text.startswith(_FORMULA) else text
