"""Whether all processes that share the database share the blobs too; else workers cannot see the uploads of others."""

import logging
import uuid
from datetime import UTC, datetime

from app.jobs.registry import ORPHANED_AFTER
from app.storage.blobs import BlobAccess
from app.storage.layout_store import LayoutStore
from models.blobs import BlobNotFound
from models.errors import StoreError

log = logging.getLogger(__name__)

LOOK_EVERY_S = 20.0
"""Pause between two looks; the first one is at the start."""
_LASTS_S = 90.0
"""Time after which a process that was killed counts as gone."""
_KIND = "process"
_FOLDER = "processes"
_MARK = b"a process that shares these blobs"


class SharedBlobs:
    """Every process keeps a mark among its blobs, and looks for those of the others that the database names."""

    def __init__(self, store: LayoutStore, blobs: BlobAccess) -> None:
        self._store = store
        self._blobs = blobs
        self._own = uuid.uuid4().hex
        self._is_there = False
        self.are_shared = True
        """Whether the marks of all other processes are among the blobs of this one."""

    async def look(self) -> None:
        """Renew the own mark, and look for the others. Raises `StoreError`."""
        await self._blobs.put(_key(self._own), _MARK, len(_MARK))
        if not self._is_there:
            before = datetime.now(UTC) - ORPHANED_AFTER
            await self._blobs.sweep(_FOLDER, before, lambda key: False)  # living processes renew theirs
        self._is_there = True
        hidden = [name for name in await self._others() if not await self._is_visible(name)]
        if hidden:  # those that have stopped meanwhile do not count
            hidden = sorted(set(hidden) & set(await self._others()))
        if self.are_shared and hidden:
            log.error(
                "%d processes of this database have other blobs than this one, so that jobs will fail: give all of "
                "them the same BLOB_URL, or one DATA_DIR",
                len(hidden),
            )
        elif hidden == [] and not self.are_shared:
            log.info("all processes of this database have the same blobs now")
        self.are_shared = not hidden

    async def leave(self) -> None:
        """Take the own mark away. Where that fails, it counts as gone a little later."""
        if not self._is_there:
            return
        try:
            await self._store.call(lambda store: store.end_presence(_KIND, self._own))
            await self._blobs.delete(_key(self._own))
        except StoreError as error:
            log.warning("the mark of this process could not be deleted: %s", error)

    async def _others(self) -> list[str]:
        return await self._store.call(lambda store: store.show_presence(_KIND, self._own, _LASTS_S))

    async def _is_visible(self, name: str) -> bool:
        try:
            await self._blobs.get(_key(name))
        except BlobNotFound:
            return False
        return True


def _key(name: str) -> str:
    return f"{_FOLDER}/{name}"
