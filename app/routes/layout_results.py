"""GET /layout/results: the newest results with their values, as JSON, JSON lines, CSV or XLSX, page by page."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, cast

from fastapi import APIRouter, Query, Request, Response

from app.access.callers import caller_of
from app.http.paging import LINK, link_next
from app.http.preconditions import Conflict
from app.http.problems import documented
from app.http.representations import choose_described_format, content_disposition
from app.routes.common_responses import FILE_NAME, STORE
from app.routes.result_tables import (
    as_it_is,
    harmless,
    rows_of_documents,
    rows_of_values,
    write_csv,
    write_workbook,
)
from app.schemas.layout_results import LIST_MEDIA_TYPES, ListFormat, ListRows, ResultEntry, ResultList
from app.schemas.options import Absent, Written
from app.state import State
from models.records import ListedResult, ResultState, Review, ReviewOrder, ReviewState
from models.repository import Store, cursor_of
from services.contract.result_json import ResultJson

router = APIRouter(tags=["layout"])

CURSOR_PATTERN = r"^([0-9]{1,9}(\.[0-9]{1,20})?(e-[0-9]{1,3})?_)?[0-9A-HJKMNP-TV-Z]{26}$"
MOST_LISTED = 200
"""Results of one answer; the documents of 200 pages with all their zones are read in 0.2 s."""
MOST_LISTED_BYTES = 4 << 20
"""Of all that is stored of the results of one answer, as JSON. The last result may reach over it."""


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
                LIST_MEDIA_TYPES["xlsx"]: {"schema": {"type": "string", "format": "binary"}},
            },
            "headers": LINK | FILE_NAME,
        },
        **documented("invalid-option", "not-acceptable", "conflict", *STORE),
    },
)
async def layout_results(
    request: Request,
    state: State,
    limit: Annotated[int, Query(ge=1, le=MOST_LISTED)] = 50,
    cursor: Annotated[
        Annotated[str, Written(CURSOR_PATTERN, "`next` of the answer before")] | Absent,
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
    rows: Annotated[
        ListRows,
        Query(
            description="Of CSV and XLSX. documents: one row for all pages of a document, with columns by label."
        ),
    ] = "values",
) -> Response:
    """List the kept results of pages with the values of their fields: the newest first, or as a review queue.

    JSON lines have one result a line, CSV and XLSX one value a row, or one document (`rows`). A result that is made
    meanwhile is not in later answers; one that expires is left out. Where results are large, an answer has fewer than
    `limit`; `next` leads on, as does the header `Link`. With API keys, the results are those of the caller's key.
    """
    chosen = choose_described_format(format, request.headers.get("accept"), LIST_MEDIA_TYPES)
    owner = caller_of(request).only

    if chosen not in ("csv", "xlsx"):
        rows = "values"

    def read(store: Store) -> tuple[Response, str | None]:
        reviews, results, following = _read(store, limit, state_, order, cursor, owner, rows)
        return _listed(results, reviews, chosen, rows, following), following

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
    rows: ListRows,
) -> tuple[dict[str, Review], list[ListedResult], str | None]:
    """What the queue knows of results, by their ids; the results in their order; the cursor of those that follow.

    Where rows are documents, the newest ones are not cut: there may be more results than `limit`.

    Raises
    ------
    Conflict
        When the cursor is that of another order.
    """
    if (order == "newest") == ("_" in (after or "")) and after is not None:
        raise Conflict("cursor: it belongs to a list in another order; begin again without it.", "cursor")
    if order == "newest" and state in (None, "confirmed", "corrected"):
        of_state = None if state is None else cast(ResultState, state)
        results, has_more = _first_of(
            store.each_result(before=after, owner=owner, state=of_state), limit, rows
        )
        reviews = store.reviews(len(results), ids=[each.id for each in results])
        following = results[-1].id if has_more else None
        return {review.id: review for review in reviews}, results, following
    reviews = store.reviews(limit + 1, state=state, order=order, after=after, owner=owner)
    known = {review.id: review for review in reviews[:limit]}
    # A result that was deleted after the queue was read is left out.
    results, has_more = _first_of(store.each_result_of(known), limit)
    if has_more:
        return known, results, cursor_of(known[results[-1].id], order)
    return known, results, cursor_of(reviews[limit - 1], order) if len(reviews) > limit else None


_LISTED = ("file_name", "class", "fields")
"""Of a result: what a list has of it."""


def _first_of(
    results: Iterator[ListedResult], limit: int, rows: ListRows = "values"
) -> tuple[list[ListedResult], bool]:
    """The first results, with what is listed of them alone, and whether there are more.

    There are `limit` at most, and fewer where their documents have more than `MOST_LISTED_BYTES`; where rows are
    documents, the pages of the last one are all there.
    """
    found: list[ListedResult] = []
    size = 0
    for each in results:
        is_full = len(found) >= limit or size >= MOST_LISTED_BYTES
        goes_on = rows == "documents" and found and each.document and each.document == found[-1].document
        if is_full and not goes_on:
            return found, True
        size += each.stored_bytes
        listed = {name: value for name, value in each.result.items() if name in _LISTED}
        found.append(replace(each, result=cast(ResultJson, listed)))
    return found, False


def _listed(
    results: Sequence[ListedResult],
    reviews: Mapping[str, Review],
    chosen: ListFormat,
    rows: ListRows,
    following: str | None,
) -> Response:
    entries = [_entry(each, reviews.get(each.id)) for each in results]
    if chosen in ("csv", "xlsx"):
        written = harmless if chosen == "csv" else as_it_is
        table = (
            rows_of_values(entries, written)
            if rows == "values"
            else rows_of_documents(_by_document(results, entries), written)
        )
        media_type = LIST_MEDIA_TYPES[chosen]
        if chosen == "csv":
            return Response(write_csv(table), media_type=media_type)
        headers = content_disposition(rows, "", media_type)
        return Response(write_workbook(table, rows), media_type=media_type, headers=headers)
    if chosen == "jsonl":
        lines = (entry.model_dump_json(by_alias=True) + "\n" for entry in entries)
        return Response("".join(lines), media_type="application/jsonl")
    body = ResultList(results=entries, next=following).model_dump_json(by_alias=True)
    return Response(body, media_type="application/json")


def _by_document(
    results: Sequence[ListedResult], entries: Sequence[ResultEntry]
) -> dict[str, list[ResultEntry]]:
    """The entries of the pages of each document by its id, in the order of the list; its pages in theirs."""
    found: dict[str, list[ResultEntry]] = {}
    for listed, entry in zip(results, entries, strict=True):
        found.setdefault(listed.document or listed.id, []).append(entry)
    return {id: sorted(pages, key=lambda page: page.id) for id, pages in found.items()}


def _entry(listed: ListedResult, review: Review | None) -> ResultEntry:
    result = listed.result
    of_class = result.get("class")
    return ResultEntry.model_validate(
        {
            "id": listed.id,
            "file_name": result.get("file_name"),
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
