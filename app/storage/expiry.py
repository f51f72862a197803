"""Deletion of what has expired, at intervals and also while no requests come."""

import asyncio
import logging
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from typing import Protocol

from app.storage.layout_store import PURGE_EVERY_S, LayoutStore
from models.errors import StoreError

log = logging.getLogger(__name__)


class Swept(Protocol):
    """Blobs that belong to rows of the store, or are limited in all."""

    async def sweep(self) -> int:
        """Delete those whose rows are gone, and those over the limit; their number."""


@asynccontextmanager
async def deleting_expired(store: LayoutStore, *blobs: Swept) -> AsyncIterator[None]:
    """Inside of the block, delete every `PURGE_EVERY_S` seconds what has expired, and blobs without a row."""
    task = asyncio.create_task(_delete_regularly(store, blobs))
    try:
        yield
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def _delete_regularly(store: LayoutStore, blobs: Sequence[Swept]) -> None:
    while True:
        try:
            await store.purge()
            gone = sum([await each.sweep() for each in blobs])
            if gone:
                log.info("blobs were deleted", extra={"blobs": gone})
        except StoreError as error:
            log.error("expired data could not be deleted: %s", error.detail)
        await asyncio.sleep(PURGE_EVERY_S)
