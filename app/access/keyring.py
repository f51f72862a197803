"""The API keys that are valid now. API_KEYS_FILE is read again when it changes."""

import asyncio
import logging
import math
import signal
import threading
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path

from app.access.known_keys import FEWEST_CHARACTERS, known_keys, short_keys
from app.roles import InvalidKeys, Key

log = logging.getLogger(__name__)

WATCH_EVERY_S = 2.0
"""Pause between two looks at the file."""
ASKED_EVERY_S = 1.0
"""Least pause between a reading and one that a SIGHUP asks for."""
SETTLED_NS = 10**9
"""A file that has not changed for this long is written completely."""
_Stamp = tuple[int, int, int]
"""What changes when a file is written or replaced: time of its last change in ns, bytes, inode."""


class Keyring:
    """The valid keys by their digests (`keys`); none: everybody may use the service.

    Where there is a file, it had a key at the start, and a file without one is never taken over. So a service that was
    started with keys is never open.
    """

    def __init__(self, entries: Sequence[str], path: Path | None) -> None:
        """`entries` are those of API_KEYS, `path` is API_KEYS_FILE. Raises `InvalidKeys`."""
        self._entries = entries
        self._path = path
        self._stamp = self._seen = _stamp_of(path)  # before the file is read, so that no change is missed
        self._due = asyncio.Event()
        self.keys: Mapping[str, Key] = known_keys(entries, path)
        if short := short_keys(entries):
            log.warning(
                "keys of API_KEYS have less than %d characters and can be guessed: %s",
                FEWEST_CHARACTERS,
                ", ".join(short),
            )

    @asynccontextmanager
    async def watched(self) -> AsyncIterator[None]:
        """Inside of the block a changed file counts after two looks at most, and on SIGHUP within a second."""
        # Other threads, as those of tests, cannot have the signals of a process.
        if threading.current_thread() is threading.main_thread():
            asyncio.get_running_loop().add_signal_handler(signal.SIGHUP, self._due.set)
        watching = asyncio.create_task(self._watch())
        try:
            yield
        finally:
            watching.cancel()
            with suppress(asyncio.CancelledError):
                await watching

    async def _watch(self) -> None:
        read_s = -math.inf
        while True:
            with suppress(TimeoutError):
                async with asyncio.timeout(WATCH_EVERY_S):
                    await self._due.wait()
            is_asked = self._due.is_set()
            if is_asked:  # signals that come meanwhile ask for the same reading
                await asyncio.sleep(read_s + ASKED_EVERY_S - time.monotonic())
                self._due.clear()
            try:  # in a thread: a network file system may hang
                if await asyncio.to_thread(self.read_again, is_asked=is_asked):
                    read_s = time.monotonic()
            except Exception:
                log.exception("API_KEYS_FILE could not be read again")

    def read_again(self, *, is_asked: bool = False) -> bool:
        """Take over the keys of the file if it has changed, or if `is_asked`; whether the file was read.

        An invalid file changes nothing. One that may still be written is left for the next look: it changed less than
        `SETTLED_NS` ago and is not the same as at the last look, or it changes while it is read.
        """
        stamp, seen = _stamp_of(self._path), self._seen
        self._seen = stamp
        if not is_asked and (stamp == self._stamp or not (stamp == seen or _is_settled(stamp))):
            return False
        try:
            found: Mapping[str, Key] | InvalidKeys = known_keys(self._entries, self._path)
        except InvalidKeys as error:
            found = error
        if _stamp_of(self._path) != stamp:
            log.info("API_KEYS_FILE has changed while it was read; it is read once more soon")
            return True
        self._stamp = stamp
        if isinstance(found, InvalidKeys):
            log.error(
                "API_KEYS_FILE has changed and cannot be used; the keys before it stay valid: %s", found
            )
            return True
        self.keys = found
        names = {key.name for key in found.values()}
        log.info("the API keys were read again", extra={"names_of_keys": len(names)})
        return True


def _is_settled(stamp: _Stamp | None) -> bool:
    """Whether nobody writes the file any more; one that is missing may be put in place at this moment."""
    return stamp is not None and stamp[0] < time.time_ns() - SETTLED_NS


def _stamp_of(path: Path | None) -> _Stamp | None:
    """The stamp of a file; None: there is no such file."""
    if path is None:
        return None
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
