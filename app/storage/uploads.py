"""Uploads in pieces: every piece is a blob, and the store says which ones have come, in which order.

So a piece is there wholly or not at all, in a folder as in a bucket, whatever process has received it. Pieces of an
upload are put together when a request names it.
"""

import secrets
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import IO

from anyio import to_thread

from app.engine.base import Busy
from app.http.form_parts import READ_BYTES
from app.storage.blobs import ALL_BLOBS, BlobAccess
from app.storage.layout_store import PURGE_EVERY_S, LayoutStore
from models.blobs import PART_BYTES, BlobNotFound
from models.errors import UploadMoved, UploadNotFound, UploadsFull
from models.records import StoredUpload, UploadBounds, UploadPiece
from services.errors import TooLarge

PIECE_BYTES = PART_BYTES
"""A body is kept in pieces of this size, so that no more is lost with the process."""
MOST_PIECES = 1000
"""Of one upload, of 32 MB as of 160: whoever sends less at a time than 160 kB, sends again too often."""
_FOLDER = "uploads"


class KeptUploads:
    """The uploads of one service. Methods raise `StoreError`, as the store and the blobs do."""

    def __init__(self, blobs: BlobAccess, store: LayoutStore, bounds: UploadBounds, ttl_s: float) -> None:
        self._blobs = blobs
        self._store = store
        self._bounds = bounds
        self._ttl_s = ttl_s

    async def begin(self, length: int, name: str | None, owner: str | None) -> StoredUpload:
        """A new upload of `length` bytes. Raises `Busy` when there are too many."""
        try:
            return await self._store.call(
                lambda store: store.add_upload(length, name, owner, self._ttl_s, self._bounds)
            )
        except UploadsFull as full:
            raise Busy(
                f"There is no room: {full.detail}. Delete one, or come again later.", int(PURGE_EVERY_S)
            ) from full

    async def find(self, upload_id: str) -> StoredUpload:
        """An upload. Raises `UploadNotFound`."""
        return await self._store.call(lambda store: store.upload(upload_id))

    async def append(self, upload: StoredUpload, content: IO[bytes], size: int) -> StoredUpload:
        """Add the first `size` bytes of a file at the end of what has come; the upload as it is then.

        Raises
        ------
        UploadNotFound, UploadMoved
            When it has gone, or another piece has come, meanwhile; then this one is not kept.
        TooLarge
            When the upload has `MOST_PIECES`.
        """
        if len(upload.pieces) >= MOST_PIECES:
            raise TooLarge(
                f"An upload may have {MOST_PIECES} pieces. Begin another one, and send larger pieces."
            )
        piece = UploadPiece(secrets.token_hex(8), size)
        key = _key(upload.id, piece)
        await self._blobs.put(key, _parts(content), size)
        try:
            return await self._store.call(lambda store: store.add_piece(upload.id, upload.received, piece))
        except (UploadNotFound, UploadMoved):
            await self._blobs.delete(key)  # only if it is known that it was not noted
            raise

    async def read_into(self, upload: StoredUpload, file: IO[bytes]) -> int:
        """Write all pieces of an upload into a file; the number of bytes. Raises `UploadNotFound` when one is gone."""
        size = 0
        try:
            for piece in upload.pieces:
                async for part in self._blobs.read(_key(upload.id, piece)):
                    size += await to_thread.run_sync(file.write, part)
        except BlobNotFound as error:
            raise UploadNotFound(
                f"the upload {upload.id!r} is not there: it was deleted, or the database was restored without its "
                "blobs; send the file again",
                upload.id,
            ) from error
        return size

    async def delete(self, upload_id: str) -> None:
        """Delete an upload. Raises `UploadNotFound`."""
        await self._store.call(lambda store: store.delete_upload(upload_id))
        await self._blobs.sweep(f"{_FOLDER}/{upload_id}", datetime.now(UTC) + ALL_BLOBS, lambda key: False)

    async def sweep(self) -> int:
        """Delete pieces whose upload is gone; their number."""
        keys: list[str] = []

        def note(key: str) -> bool:
            keys.append(key)
            return True

        await self._blobs.sweep(_FOLDER, datetime.now(UTC) + ALL_BLOBS, note)
        kept = await self._store.call(lambda store: store.kept_uploads({_id_of(key) for key in keys}))
        gone = [key for key in keys if _id_of(key) not in kept]
        if gone:
            await self._blobs.delete(*gone)
        return len(gone)


def _key(upload_id: str, piece: UploadPiece) -> str:
    return f"{_FOLDER}/{upload_id}/{piece.name}"


def _id_of(key: str) -> str:
    return key.split("/")[1]


def _parts(content: IO[bytes]) -> Iterator[bytes]:
    content.seek(0)
    while part := content.read(READ_BYTES):
        yield part
