"""Advisory locks, identified by name, for processes of one machine that share a folder.

Correctness does not depend on the locks. A process without the lock may lose its work, because another process writes
a version first (`VersionConflict`). Four processes that update one model continuously lose most of their work this way.
The operating system releases the locks of a process that is killed.
"""

import asyncio
import fcntl
import os
import random
import time
import zlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

SHORTEST_PAUSE_S, LONGEST_PAUSE_S = 0.002, 0.02
"""Pause between two attempts to lock. A lock is held for about 50 ms."""
_random = random.Random()


class InterprocessLock:
    """Locks, identified by name. A name is one byte of one shared file, so the file needs no cleaning.

    Tasks of one process do not exclude each other.
    """

    def __init__(self, file: Path | None) -> None:
        """Without a `file`, no lock is taken."""
        self._file = file
        self._open: int | None = None
        self._held: set[int] = set()

    def holds(self, name: str) -> bool:
        """Whether this process has the lock now."""
        return _place(name) in self._held

    @asynccontextmanager
    async def take(self, name: str, patience_s: float) -> AsyncIterator[None]:
        """Hold the lock of `name` during the block. After `patience_s` seconds the block starts without the lock."""
        place = _place(name)
        is_taken = await self._try(place, time.monotonic() + patience_s)
        try:
            yield
        finally:
            self._held.discard(place)
            if is_taken and self._open is not None:
                with suppress(OSError):
                    fcntl.lockf(self._open, fcntl.LOCK_UN, 1, place)

    async def _try(self, place: int, until: float) -> bool:
        if self._file is None:
            return False
        try:
            if self._open is None:
                self._open = os.open(self._file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            while True:
                with suppress(BlockingIOError, PermissionError):
                    fcntl.lockf(self._open, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
                    self._held.add(place)
                    return True
                if time.monotonic() > until:
                    return False
                await asyncio.sleep(_random.uniform(SHORTEST_PAUSE_S, LONGEST_PAUSE_S))
        except OSError:  # the file system has no locks; some network drives do not
            return False

    def close(self) -> None:
        """Release all locks."""
        if self._open is not None:
            os.close(self._open)
            self._open = None


def _place(name: str) -> int:
    return zlib.crc32(name.encode("utf-8", "surrogatepass"))
