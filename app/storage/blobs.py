"""Access of the app to blobs: in a limited number of threads, never in the event loop."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime, timedelta
from pathlib import Path
from typing import TypeVar

from app.storage.probe import PROBE_TIMEOUT_S, Probe
from models.blobs import Blobs
from models.errors import StoreError, StoreUnavailable

T = TypeVar("T")
FOLDER = "blobs"
"""Folder of the blobs in the data folder, where no bucket is configured."""
ALL_BLOBS = timedelta(days=1)
"""From now: blobs that were written before then are all blobs, even if clocks differ."""
MOST_THREADS = 4
"""Blobs that are written or read at once; one disk is not faster with more."""


class BlobAccess:
    """The blobs of one service; its methods work only inside the `opened` block of the service.

    Every method raises `StoreUnavailable` when the folder or the bucket does not answer in time. What has begun then
    goes on in its thread.
    """

    def __init__(self, url: str, data_dir: Path, timeout_s: float = 60.0) -> None:
        """`timeout_s` limits the time of one call."""
        self._url = url
        self._folder = data_dir / FOLDER
        self._timeout_s = timeout_s
        self._threads = ThreadPoolExecutor(MOST_THREADS, "blobs")
        self._probe = Probe(self._is_writable, "blobs-probe")
        self._blobs: Blobs | None = None

    async def open(self) -> None:
        """Open the folder or the bucket. Raises `StoreUnavailable`."""
        self._blobs = await asyncio.to_thread(Blobs, self._url, self._folder)

    async def close(self) -> None:
        """Wait for calls that have begun, and take no more."""
        self._blobs = None
        self._probe.close()
        await asyncio.to_thread(self._threads.shutdown)

    async def put(self, key: str, content: bytes | Iterable[bytes], most_bytes: int) -> int:
        """Write a blob and return its number of bytes; the parts are read in a thread. See `Blobs.put`."""
        return await self._call(lambda blobs: blobs.put(key, content, most_bytes))

    async def get(self, key: str) -> bytes:
        """The content of a blob. Raises `BlobNotFound`."""
        return await self._call(lambda blobs: blobs.get(key))

    async def read(self, key: str) -> AsyncIterator[bytes]:
        """Yield the parts of a blob. Raises `BlobNotFound`."""
        parts = await self._call(lambda blobs: blobs.read(key))
        while part := await self._call(lambda _: next(parts, b"")):
            yield part

    async def delete(self, *keys: str) -> None:
        """Delete blobs; those that do not exist are ignored."""
        await self._call(lambda blobs: blobs.delete(*keys))

    async def sweep(self, prefix: str, before: datetime, is_wanted: Callable[[str], bool]) -> int:
        """Delete old blobs that are not wanted; their number. See `Blobs.sweep`."""
        return await self._call(lambda blobs: blobs.sweep(prefix, before, is_wanted))

    async def is_available(self) -> bool:
        """Whether a blob can be written now; False if that is not known within `PROBE_TIMEOUT_S`."""
        return self._blobs is not None and bool(await self._probe.result(PROBE_TIMEOUT_S))

    def _is_writable(self) -> bool:
        try:
            self._opened().check()
        except StoreError:
            return False
        return True

    async def _call(self, work: Callable[[Blobs], T]) -> T:
        blobs = self._opened()
        try:
            async with asyncio.timeout(self._timeout_s):
                return await asyncio.get_running_loop().run_in_executor(self._threads, work, blobs)
        except TimeoutError:
            raise StoreUnavailable(
                f"the store of blobs did not answer within {self._timeout_s:g} s"
            ) from None

    def _opened(self) -> Blobs:
        if self._blobs is None:
            raise StoreUnavailable("the store of blobs is closed")
        return self._blobs
