"""A file in the data folder that says what a back-up needs, to whoever looks there."""

from contextlib import suppress
from pathlib import Path

NAME = "BACK-UP.txt"
TEXT = """\
What is in this folder, and how to back it up while the service runs
====================================================================

layout.sqlite3        the database
layout.sqlite3-wal    its newest part: a copy of layout.sqlite3 alone lacks it, and still looks intact
blobs/                pictures of pages, images of samples, uploads and results of jobs

The back-up holds the same secrets: begin with `umask 077`, so that only you can read it.
1. The database, by SQLite itself, which takes both files together:
   python3 -c 'import sqlite3; sqlite3.connect("file:layout.sqlite3?mode=rw", uri=True).backup(sqlite3.connect("/BACKUP/layout.sqlite3"))'
2. Then the folder blobs:
   cp -a blobs /BACKUP/

To restore, stop the service and put both into an empty folder. More: docs/operations.md, Back-up.
"""  # noqa: E501 (a command is one line)


def write_note(folder: Path) -> None:
    """Write the file, if it is not there as it is now. A folder that cannot be written is reported by the database."""
    path = folder / NAME
    with suppress(OSError):
        if not path.exists() or path.read_text("utf-8") != TEXT:
            path.write_text(TEXT, "utf-8")
