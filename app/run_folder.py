"""A folder for the temporary files of one run of the service.

Most temporary files have no name and end with their process. Sockets of worker processes have one, and stay behind
when the service is killed. Each run puts them into a folder that it keeps locked; the next run deletes folders without
a lock.
"""

import fcntl
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PREFIX = "document-rectification-"
_LOCK = "lock"
_MULTIPROCESSING = "pymp-"
"""Prefix of the folder with the sockets of multiprocessing."""
_LONGEST_PARENT = 40
"""Characters; the path of a socket has 107 at most, and 63 of them are those of its folders and its name."""
_YOUNG_S = 60.0
"""A folder that is younger may belong to a service that has not locked it yet."""


@contextmanager
def run_folder() -> Iterator[Path]:
    """Delete what killed runs left behind; temporary files inside the block are made in a folder that ends with it."""
    before, parent = tempfile.tempdir, Path(tempfile.gettempdir())
    sweep(parent)
    if len(str(parent)) > _LONGEST_PARENT:
        # Sockets of worker processes in a deeper folder would have too long a path.
        yield parent
        return
    folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=parent))
    with (folder / _LOCK).open("wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        tempfile.tempdir = str(folder)
        try:
            yield folder
        finally:
            tempfile.tempdir = before
            _empty(folder)


def _empty(folder: Path) -> None:
    """Delete all but the folder of multiprocessing, which deletes it itself at the end of the process.

    The folder that then stays is empty, and the next run sweeps it.
    """
    for child in folder.iterdir():
        if not child.name.startswith(_MULTIPROCESSING):
            shutil.rmtree(child, ignore_errors=True) if child.is_dir() else child.unlink(missing_ok=True)
    with suppress(OSError):
        folder.rmdir()


def sweep(parent: Path) -> None:
    """Delete the folders in `parent` that belong to killed runs of this user."""
    for folder in parent.glob(PREFIX + "*"):
        with suppress(OSError):
            status = folder.lstat()
            if status.st_uid == os.geteuid() and not folder.is_symlink() and not _is_used(folder):
                shutil.rmtree(folder, ignore_errors=True)


def _is_used(folder: Path) -> bool:
    """Whether a run has locked the folder, or may be about to."""
    try:
        with (folder / _LOCK).open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except FileNotFoundError:
        return time.time() - folder.stat().st_mtime < _YOUNG_S
    return False
