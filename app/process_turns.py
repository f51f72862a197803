"""Turns that processes of one machine take over one folder, as a courtesy: nothing depends on them.

Who learns without its turn may have worked for nothing, because another was faster (`VersionConflict`); four processes
that teach one model all the time throw most of their work away so. A kill ends a turn as its process ends.
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
"""Between two looks whether the turn is free; a turn takes some 50 ms."""


class ProcessTurns:
    """Turns by name: one byte of one file is locked for each, so that names leave nothing behind.

    Tasks of one process do not exclude each other.
    """

    def __init__(self, file: Path | None) -> None:
        """None: nobody shares anything, and every turn is free at once."""
        self._file = file
        self._open: int | None = None
        self._held: set[int] = set()

    def holds(self, name: str) -> bool:
        """Whether somebody of this process has the turn now."""
        return _place(name) in self._held

    @asynccontextmanager
    async def take(self, name: str, patience_s: float) -> AsyncIterator[None]:
        """The turn of `name` for the block, which begins without it when it does not come within `patience_s`."""
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
                await asyncio.sleep(random.uniform(SHORTEST_PAUSE_S, LONGEST_PAUSE_S))
        except OSError:  # a folder without locks, as some network drives are
            return False

    def close(self) -> None:
        """Give all turns back."""
        if self._open is not None:
            os.close(self._open)
            self._open = None


def _place(name: str) -> int:
    return zlib.crc32(name.encode("utf-8", "surrogatepass"))
