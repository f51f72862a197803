"""The store's calls for data that expires: results of recognition, and pages that fitted no class."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import cast

from sqlalchemy import ColumnElement, CursorResult, Select, delete, select
from sqlalchemy.orm import Session

from models.documents import Document, decode_document, decode_measured, encode_document
from models.errors import ResultNotFound, UnknownPageNotFound
from models.queries import READ_AT_ONCE, add_unknown_page, present_ids, review_of, something_wrong
from models.records import (
    ListedResult,
    ResultDraft,
    ResultState,
    ReviewDraft,
    StoredResult,
    StoredUnknownPage,
    UnknownPageDraft,
)
from models.tables import FeedbackRow, ResultRow, UnknownPageRow
from models.transactions import Transactions
from models.ulid import is_ulid
from services.contract.page_json import PageJson
from services.contract.result_json import StoredResultJson


class ResultRepository(Transactions):
    """Results, which expire, and a limited number of unknown pages."""

    def add_result(
        self,
        document: Document,
        ttl_s: float,
        unknown: UnknownPageDraft | None = None,
        owner: str | None = None,
        review: ReviewDraft | None = None,
    ) -> str:
        """Store a result for `ttl_s` seconds, and its page if no class fits; return the result's id."""
        with self._changing() as (session, _):
            now = self._clock()
            [id] = self._new_ids(session, ResultRow.id, now)
            self._keep(session, [id], [ResultDraft(document, unknown, owner, review)], now, ttl_s)
        return id

    def add_document(
        self, document: Document, pages: Sequence[ResultDraft], ttl_s: float
    ) -> tuple[str, list[str]]:
        """Store the results of a document and of its pages in one transaction; return their ids.

        The stored document has the ids of its pages under `pages`, they have its id under `in_document`. Its own id is
        older than theirs, so that a purge deletes the document before its first page.
        """
        with self._changing() as (session, _):
            now = self._clock()
            document_id, *page_ids = self._new_ids(session, ResultRow.id, now, 1 + len(pages))
            whole = ResultDraft({**document, "pages": page_ids}, owner=pages[0].owner if pages else None)
            parts = [replace(page, document={**page.document, "in_document": document_id}) for page in pages]
            self._keep(session, [document_id, *page_ids], [whole, *parts], now, ttl_s)
        return document_id, page_ids

    def _keep(
        self,
        session: Session,
        ids: Sequence[str],
        drafts: Sequence[ResultDraft],
        now: datetime,
        ttl_s: float,
    ) -> None:
        expires_at = now + timedelta(seconds=ttl_s)
        rows = [
            ResultRow(
                id=id,
                created_at=now,
                expires_at=expires_at,
                document=encode_document(draft.document),
                owner=draft.owner,
            )
            for id, draft in zip(ids, drafts, strict=True)
        ]
        session.add_all(rows)
        for row, draft in zip(rows, drafts, strict=True):
            if draft.unknown is not None:
                [page_id] = self._new_ids(session, UnknownPageRow.id, now)
                add_unknown_page(session, page_id, row.id, draft.unknown, now)
        session.flush()
        session.add_all(
            review_of(row, draft.review)
            for row, draft in zip(rows, drafts, strict=True)
            if draft.review is not None
        )

    def result(self, result_id: str) -> StoredResult:
        """A result, for a document with the results of its pages. Raises `ResultNotFound`."""
        now = self._clock()
        with self._reading() as session:
            row = session.get(ResultRow, result_id) if is_ulid(result_id) else None
            result = None if row is None or row.expires_at <= now else _stored_result(row)
            rows = (
                []
                if result is None
                else [session.get(ResultRow, id) for id in result.document.get("pages", ())]
            )
        if result is None or None in rows:
            raise ResultNotFound(f"there is no result {result_id!r}, or no longer", result_id)
        return replace(result, pages=tuple(_stored_result(page) for page in rows if page is not None))

    def each_result(
        self,
        *,
        before: str | None = None,
        owner: str | None = None,
        state: ResultState | None = None,
    ) -> Iterator[ListedResult]:
        """Iterates over the results of pages that are kept, newest first. One is decoded at a time.

        `before` is the id of a result: only older ones are listed. `owner` and `state` select; None: all.
        """
        verified, corrected = _verdicts_of_row()
        wanted = select(ResultRow, verified, corrected).where(ResultRow.expires_at > self._clock())
        if before is not None:
            wanted = wanted.where(ResultRow.id < before)
        if owner is not None:
            wanted = wanted.where(ResultRow.owner == owner)
        if state is not None:
            wanted = wanted.where(verified if state != "open" else ~verified)
        if state in ("confirmed", "corrected"):
            wanted = wanted.where(corrected if state == "corrected" else ~corrected)
        with self._reading() as session:
            yield from _each_listed(session, wanted.order_by(ResultRow.id.desc()))

    def each_result_of(self, ids: Iterable[str]) -> Iterator[ListedResult]:
        """Iterates over these results in their order, one decoded at a time; those that are not kept are left out."""
        verified, corrected = _verdicts_of_row()
        wanted = select(ResultRow, verified, corrected).where(ResultRow.expires_at > self._clock())
        with self._reading() as session:
            for id in ids:
                yield from _each_listed(session, wanted.where(ResultRow.id == id))

    def result_owner(self, result_id: str) -> str | None:
        """The owner of a result, or of the feedback on a result that is no longer kept. Raises `ResultNotFound`."""
        if is_ulid(result_id):
            with self._reading() as session:
                row = session.get(ResultRow, result_id)
                if row is not None:
                    return row.owner
                of_result = select(FeedbackRow.owner).where(FeedbackRow.result_id == result_id).limit(1)
                left = session.execute(of_result).first()
                if left is not None:
                    return left[0]
        raise ResultNotFound(f"there is no result {result_id!r}, or no longer", result_id)

    def delete_result(self, result_id: str) -> list[str]:
        """Delete a result, the results of its pages, and their unknown pages; return the ids of the deleted results.

        Feedback remains, with its sample: `undo_feedback` deletes both. Raises `ResultNotFound`.
        """
        with self._changing() as (session, _):
            row = session.get(ResultRow, result_id) if is_ulid(result_id) else None
            if row is None:
                raise ResultNotFound(f"there is no result {result_id!r}, or no longer", result_id)
            ids = [result_id, *decode_document(row.document, StoredResultJson).get("pages", ())]
            session.execute(delete(UnknownPageRow).where(UnknownPageRow.result_id.in_(ids)))
            session.execute(delete(ResultRow).where(ResultRow.id.in_(ids)))
            self._list_change(session, None, result_id)
            return ids

    def kept_results(self, result_ids: Collection[str]) -> set[str]:
        """Those of the ids under which a result is kept that has not expired."""
        with self._reading() as session:
            return present_ids(session, ResultRow.id, result_ids, ResultRow.expires_at > self._clock())

    def purge_results(self, now: datetime | None = None, keep_newest: int | None = None) -> int:
        """Delete results that have expired at `now` (aware), and all but the `keep_newest` newest; return their number.

        Unknown pages that have expired are deleted too.
        """
        now = now or self._clock()
        gone: ColumnElement[bool] = ResultRow.expires_at <= now
        with self._changing() as (session, _):
            session.execute(delete(UnknownPageRow).where(UnknownPageRow.expires_at <= now))
            if keep_newest is not None:
                newest = select(ResultRow.id).order_by(ResultRow.id.desc()).offset(keep_newest).limit(1)
                last = session.execute(newest).scalar_one_or_none()
                if last is not None:
                    gone |= ResultRow.id <= last
            return cast(CursorResult[None], session.execute(delete(ResultRow).where(gone))).rowcount

    def each_unknown_page(self) -> Iterator[StoredUnknownPage]:
        """Iterates over the unknown pages that have not expired, oldest first. Few are in memory at a time."""
        with self._reading() as session:
            wanted = select(UnknownPageRow).where(UnknownPageRow.expires_at > self._clock())
            wanted = wanted.order_by(UnknownPageRow.id)
            for row in session.execute(wanted.execution_options(yield_per=READ_AT_ONCE)).scalars():
                yield _unknown_page(row)
                session.expunge(row)

    def unknown_page(self, page_id: str) -> StoredUnknownPage:
        """One unknown page. Raises `UnknownPageNotFound`."""
        with self._reading() as session:
            row = session.get(UnknownPageRow, page_id) if is_ulid(page_id) else None
        if row is None or row.expires_at <= self._clock():
            raise UnknownPageNotFound(f"there is no unknown page {page_id!r}, or no longer", page_id)
        return _unknown_page(row)

    def forget_unknown_pages(self, page_ids: Sequence[str]) -> int:
        """Delete unknown pages; return their number. Callers delete pages that now have a class, or need none."""
        ids = {page_id for page_id in page_ids if is_ulid(page_id)}
        with self._changing() as (session, _):
            gone = session.execute(delete(UnknownPageRow).where(UnknownPageRow.id.in_(ids)))
            count = cast(CursorResult[None], gone).rowcount
            if count:
                self._list_change(session, None, ", ".join(sorted(ids)))
            return count


def _verdicts_of_row() -> tuple[ColumnElement[bool], ColumnElement[bool]]:
    """Whether a person has verified the result of a row, and whether something was wrong."""
    of_row = select(FeedbackRow.id).where(FeedbackRow.result_id == ResultRow.id)
    return of_row.exists(), of_row.where(something_wrong()).exists()


def _each_listed(session: Session, wanted: Select[ResultRow, bool, bool]) -> Iterator[ListedResult]:
    for row, is_verified, is_corrected in session.execute(wanted.execution_options(yield_per=READ_AT_ONCE)):
        document, size = decode_measured(row.document, StoredResultJson)
        if "result" in document:  # a document's values are those of its pages
            found: ResultState = "confirmed" if is_verified else "open"
            found = "corrected" if is_corrected else found
            result = document["result"]
            whole = document.get("in_document")  # True: an older release has stored the page
            whole = whole if isinstance(whole, str) else None
            yield ListedResult(row.id, result, size, row.created_at, row.expires_at, found, whole)
        session.expunge(row)


def _stored_result(row: ResultRow) -> StoredResult:
    return StoredResult(
        row.id, decode_document(row.document, StoredResultJson), row.created_at, row.expires_at, row.owner
    )


def _unknown_page(row: UnknownPageRow) -> StoredUnknownPage:
    return StoredUnknownPage(
        row.id, row.result_id, decode_document(row.document, PageJson), row.created_at, row.owner
    )
