"""The store's calls for uploads in pieces: who sends what, and which pieces have come. They expire."""

import json
from collections.abc import Collection
from datetime import datetime, timedelta
from typing import cast

from sqlalchemy import CursorResult, delete, func, select
from sqlalchemy.orm import Session

from models.errors import UploadMoved, UploadNotFound, UploadsFull
from models.queries import present_ids
from models.records import StoredUpload, UploadBounds, UploadPiece
from models.tables import UploadRow
from models.transactions import Transactions
from models.ulid import is_ulid


class UploadRepository(Transactions):
    """Uploads in pieces; the pieces are blobs."""

    def add_upload(
        self, length: int, name: str | None, owner: str | None, ttl_s: float, bounds: UploadBounds
    ) -> StoredUpload:
        """Begin an upload of `length` bytes, which is kept for `ttl_s` seconds; its length counts from now on.

        Raises
        ------
        UploadsFull
            When there is no room; the detail names the setting.
        """
        with self._changing() as (session, _):
            now = self._clock()
            _require_room(session, now, length, owner, bounds)
            [id] = self._new_ids(session, UploadRow.id, now)
            row = UploadRow(
                id=id,
                created_at=now,
                expires_at=now + timedelta(seconds=ttl_s),
                owner=owner,
                name=name,
                length=length,
                received=0,
                pieces="[]",
            )
            session.add(row)
            return _stored(row)

    def upload(self, upload_id: str) -> StoredUpload:
        """An upload that has not expired. Raises `UploadNotFound`."""
        with self._glancing() as session:
            return _stored(self._row(session, upload_id))

    def add_piece(self, upload_id: str, offset: int, piece: UploadPiece) -> StoredUpload:
        """Note a piece that is stored and begins at `offset`; the upload with it.

        Of two pieces that come at once for the same place, the second one is refused.

        Raises
        ------
        UploadNotFound
        UploadMoved
            When the upload does not end at `offset`.
        """
        with self._changing() as (session, _):
            row = self._row(session, upload_id)
            if row.received != offset:
                raise UploadMoved(
                    f"the upload has {row.received} bytes, and this piece begins at {offset}: ask for the offset "
                    "(HEAD), and go on from there"
                )
            row.pieces = json.dumps([*json.loads(row.pieces), list(piece)])
            row.received = offset + piece.size
            return _stored(row)

    def delete_upload(self, upload_id: str) -> None:
        """Delete an upload. Raises `UploadNotFound`."""
        with self._changing() as (session, _):
            session.delete(self._row(session, upload_id))

    def kept_uploads(self, upload_ids: Collection[str]) -> set[str]:
        """Those of the ids under which there is an upload that has not expired."""
        with self._reading() as session:
            return present_ids(session, UploadRow.id, upload_ids, UploadRow.expires_at > self._clock())

    def purge_uploads(self) -> int:
        """Delete uploads that have expired; their number."""
        with self._changing() as (session, _):
            gone = delete(UploadRow).where(UploadRow.expires_at <= self._clock())
            return cast(CursorResult[None], session.execute(gone)).rowcount

    def _row(self, session: Session, upload_id: str) -> UploadRow:
        row = session.get(UploadRow, upload_id) if is_ulid(upload_id) else None
        if row is None or row.expires_at <= self._clock():
            raise UploadNotFound(f"there is no upload {upload_id!r}, or no longer", upload_id)
        return row


def _require_room(
    session: Session, now: datetime, length: int, owner: str | None, bounds: UploadBounds
) -> None:
    alive = UploadRow.expires_at > now
    count, size = session.execute(
        select(func.count(), func.coalesce(func.sum(UploadRow.length), 0)).where(alive)
    ).one()
    own = session.execute(select(func.count()).where(alive, UploadRow.owner == owner)).scalar_one()
    if own >= bounds.most_of_owner:
        raise UploadsFull(f"{own} uploads of this key are kept (MAX_KEPT_UPLOADS_PER_KEY)")
    if count >= bounds.most:
        raise UploadsFull(f"{count} uploads are kept (MAX_KEPT_UPLOADS)")
    if size + length > bounds.most_bytes:
        raise UploadsFull(
            f"all uploads may come to {bounds.most_bytes} bytes together (MAX_KEPT_UPLOADS_BYTES)"
        )


def _stored(row: UploadRow) -> StoredUpload:
    pieces = tuple(UploadPiece(*each) for each in json.loads(row.pieces))
    return StoredUpload(
        row.id, row.owner, row.name, row.length, row.received, pieces, row.created_at, row.expires_at
    )
