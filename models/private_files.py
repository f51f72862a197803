"""Files and folders that only their owner may read: pages of people, and the secret that signs tokens."""

import os
import stat
from contextlib import suppress
from pathlib import Path

_LOG_FILES = ("-wal", "-shm")
"""SQLite's files beside a database; new ones get the mode of the database."""
_OTHERS = stat.S_IRWXG | stat.S_IRWXO


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, if it is missing; one that is there keeps its mode. Raises `OSError`."""
    folder.mkdir(mode=stat.S_IRWXU, parents=True, exist_ok=True)


def make_database(path: Path) -> None:
    """Make an empty SQLite database if it is missing; one that is there is narrowed. Raises `OSError`.

    A database that is there is not opened: closing a descriptor of it would release the locks that SQLite has on it in
    this process.
    """
    with suppress(FileExistsError):
        os.close(os.open(path.resolve(), os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600))
    for each in (path, *(path.with_name(path.name + ending) for ending in _LOG_FILES)):
        narrow(each)


def narrow(path: Path) -> None:
    """Take the rights of others from a file or a folder that belongs to this process's user, where that is possible."""
    with suppress(OSError):  # missing, or a file system without modes
        found = path.stat()
        if found.st_uid == os.geteuid() and found.st_mode & _OTHERS:
            path.chmod(stat.S_IMODE(found.st_mode) & ~_OTHERS)
