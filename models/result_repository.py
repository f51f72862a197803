"""The store's calls about what is kept for a while: results of recognition, and pages that fitted no class."""

from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from typing import cast

from sqlalchemy import ColumnElement, CursorResult, delete, select

from models.documents import Document, decode_document, encode_document
from models.errors import ResultNotFound, UnknownPageNotFound
from models.queries import READ_AT_ONCE, require_result_id
from models.records import StoredResult, UnknownPage
from models.tables import ResultRow, UnknownPageRow
from models.transactions import Transactions
from models.ulid import is_ulid

UNKNOWN_TTL_S = 30 * 86400.0
"""Seconds: new kinds of documents show themselves in weeks, and a page that nobody asked for shall not stay longer."""


class KeptResults(Transactions):
    """Results, which expire, and a ring of unknown pages."""

    def add_result(self, document: Document, ttl_s: float) -> str:
        """Keep the answer to a recognition for `ttl_s` seconds; its id is handed out."""
        packed, now = encode_document(document), self._clock()
        row = ResultRow(
            id=self._ulids.make(now),
            created_at=now,
            expires_at=now + timedelta(seconds=ttl_s),
            document=packed,
        )
        with self._writing() as session:
            session.add(row)
        return row.id

    def result(self, result_id: str) -> StoredResult:
        """An answer that is still kept; `ResultNotFound`."""
        with self._reading() as session:
            row = session.get(ResultRow, result_id) if is_ulid(result_id) else None
        if row is None or row.expires_at <= self._clock():
            raise ResultNotFound(f"there is no result {result_id!r}, or no longer", result_id)
        return StoredResult(row.id, decode_document(row.document), row.created_at, row.expires_at)

    def purge_results(self, now: datetime | None = None, keep_newest: int | None = None) -> int:
        """Delete what has expired by `now` (aware) and all but the newest; how many results went.

        Unknown pages that have expired go with them.
        """
        now = now or self._clock()
        gone: ColumnElement[bool] = ResultRow.expires_at <= now
        with self._writing() as session:
            session.execute(delete(UnknownPageRow).where(UnknownPageRow.expires_at <= now))
            if keep_newest is not None:
                newest = select(ResultRow.id).order_by(ResultRow.id.desc()).offset(keep_newest).limit(1)
                last = session.execute(newest).scalar_one_or_none()
                if last is not None:
                    gone |= ResultRow.id <= last
            return cast(CursorResult[None], session.execute(delete(ResultRow).where(gone))).rowcount

    def keep_unknown_page(
        self, page: Document, result_id: str, bound: int, ttl_s: float = UNKNOWN_TTL_S
    ) -> UnknownPage:
        """Keep a page that fitted no class for `ttl_s` seconds; of more than `bound` the oldest go.

        A page counts once for its result: the answer is then the one that is there.
        """
        require_result_id(result_id)
        packed, now = encode_document(page), self._clock()
        with self._changing() as (session, _):
            session.execute(delete(UnknownPageRow).where(UnknownPageRow.expires_at <= now))
            of_result = select(UnknownPageRow).where(UnknownPageRow.result_id == result_id)
            row = session.execute(of_result).scalar_one_or_none()
            if row is None:
                row = UnknownPageRow(
                    id=self._ulids.make(now),
                    result_id=result_id,
                    created_at=now,
                    expires_at=now + timedelta(seconds=ttl_s),
                    document=packed,
                )
                session.add(row)
                session.flush()
            newest = select(UnknownPageRow.id).order_by(UnknownPageRow.id.desc()).offset(bound).limit(1)
            last = session.execute(newest).scalar_one_or_none()
            if last is not None:
                session.execute(delete(UnknownPageRow).where(UnknownPageRow.id <= last))
        return _unknown_page(row)

    def each_unknown_page(self) -> Iterator[UnknownPage]:
        """Pages that fitted no class and are still kept, oldest first; never all are in memory."""
        with self._reading() as session:
            wanted = select(UnknownPageRow).where(UnknownPageRow.expires_at > self._clock())
            wanted = wanted.order_by(UnknownPageRow.id)
            for row in session.execute(wanted.execution_options(yield_per=READ_AT_ONCE)).scalars():
                yield _unknown_page(row)
                session.expunge(row)

    def unknown_page(self, page_id: str) -> UnknownPage:
        """One of them; `UnknownPageNotFound`."""
        with self._reading() as session:
            row = session.get(UnknownPageRow, page_id) if is_ulid(page_id) else None
        if row is None or row.expires_at <= self._clock():
            raise UnknownPageNotFound(f"there is no unknown page {page_id!r}, or no longer", page_id)
        return _unknown_page(row)

    def forget_unknown_pages(self, page_ids: Sequence[str]) -> int:
        """Delete pages that have found a class, or that nobody shall be asked about again; how many went."""
        ids = {page_id for page_id in page_ids if is_ulid(page_id)}
        with self._changing() as (session, _):
            gone = session.execute(delete(UnknownPageRow).where(UnknownPageRow.id.in_(ids)))
            return cast(CursorResult[None], gone).rowcount


def _unknown_page(row: UnknownPageRow) -> UnknownPage:
    return UnknownPage(row.id, row.result_id, decode_document(row.document), row.created_at)
