"""Deletion of what has expired, at intervals and also while no requests come."""

import asyncio
import logging
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress

from app.storage.kept_images import KeptImages
from app.storage.layout_store import LayoutStore
from models.errors import StoreError

log = logging.getLogger(__name__)

EVERY_S = 60.0
"""Results live for hours, so a minute more is little."""


@asynccontextmanager
async def deleting_expired(store: LayoutStore, *images: KeptImages) -> AsyncIterator[None]:
    """Delete expired results, unknown pages and pictures every `EVERY_S` seconds inside of the block."""
    task = asyncio.create_task(_delete_regularly(store, images))
    try:
        yield
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def _delete_regularly(store: LayoutStore, images: Sequence[KeptImages]) -> None:
    while True:
        try:
            await store.purge()
            gone = sum([await each.sweep() for each in images])
            if gone:
                log.info("pictures were deleted", extra={"pictures": gone})
        except StoreError as error:
            log.error("expired data could not be deleted: %s", error.detail)
        await asyncio.sleep(EVERY_S)
