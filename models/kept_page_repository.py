"""The store's calls for kept pages: what is known of photos that are kept for later answers. They expire."""

from collections.abc import Collection, Sequence
from datetime import timedelta
from typing import cast

from sqlalchemy import ColumnElement, CursorResult, delete, select
from sqlalchemy.orm import Session

from models.documents import Document, decode_document, encode_document
from models.errors import KeptPageNotFound
from models.queries import present_ids
from models.records import StoredPage
from models.tables import KeptPageRow
from models.transactions import Transactions
from models.ulid import is_ulid
from services.contract.kept_pages import KeptPageJson


class KeptPageRepository(Transactions):
    """Kept pages; their photos are blobs."""

    def add_kept_pages(self, documents: Sequence[Document], ttl_s: float, owner: str | None) -> list[str]:
        """Store pages of `owner` for `ttl_s` seconds; return their ids in the same order."""
        with self._changing() as (session, _):
            now = self._clock()
            ids = self._new_ids(session, KeptPageRow.id, now, len(documents))
            session.add_all(
                KeptPageRow(
                    id=id,
                    created_at=now,
                    expires_at=now + timedelta(seconds=ttl_s),
                    document=encode_document(document),
                    owner=owner,
                )
                for id, document in zip(ids, documents, strict=True)
            )
        return ids

    def kept_page(self, page_id: str) -> StoredPage:
        """A page that has not expired. Raises `KeptPageNotFound`."""
        with self._glancing() as session:
            row = _row(session, page_id)
            if row.expires_at <= self._clock():
                raise _missing(page_id)
            return StoredPage(row.id, decode_document(row.document, KeptPageJson), row.created_at, row.owner)

    def change_kept_page(self, page_id: str, document: Document) -> None:
        """Replace the document of a page. Raises `KeptPageNotFound`."""
        with self._changing() as (session, _):
            _row(session, page_id).document = encode_document(document)

    def delete_kept_page(self, page_id: str) -> None:
        """Delete a page. Raises `KeptPageNotFound`."""
        with self._changing() as (session, _):
            session.delete(_row(session, page_id))
            self._list_change(session, None, page_id)

    def kept_pages(self, page_ids: Collection[str]) -> set[str]:
        """Those of the ids under which a page is kept that has not expired."""
        with self._reading() as session:
            return present_ids(session, KeptPageRow.id, page_ids, KeptPageRow.expires_at > self._clock())

    def purge_kept_pages(self, keep_newest: int | None = None) -> int:
        """Delete pages that have expired, and all but the `keep_newest` newest; their number."""
        gone: ColumnElement[bool] = KeptPageRow.expires_at <= self._clock()
        with self._changing() as (session, _):
            if keep_newest is not None:
                newest = select(KeptPageRow.id).order_by(KeptPageRow.id.desc()).offset(keep_newest).limit(1)
                last = session.execute(newest).scalar_one_or_none()
                if last is not None:
                    gone |= KeptPageRow.id <= last
            return cast(CursorResult[None], session.execute(delete(KeptPageRow).where(gone))).rowcount


def _row(session: Session, page_id: str) -> KeptPageRow:
    row = session.get(KeptPageRow, page_id) if is_ulid(page_id) else None
    if row is None:
        raise _missing(page_id)
    return row


def _missing(page_id: str) -> KeptPageNotFound:
    return KeptPageNotFound(f"there is no kept page {page_id!r}, or no longer", page_id)
