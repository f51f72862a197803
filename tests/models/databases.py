"""The databases that the store's promises are tested on: SQLite, and PostgreSQL where its server is installed."""

import os
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.common.postgresql import IS_INSTALLED, Cluster
from models.repository import Store
from models.tables import Table

PAGE = 4096
"""Bytes of a page of SQLite's file."""
KINDS = ("sqlite", "postgresql") if IS_INSTALLED else ("sqlite",)


@cache
def _migrated() -> bytes:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "store.sqlite3"
        Store.open(path).close()
        return path.read_bytes()


def make_file(path: Path) -> Path:
    """Write a database of SQLite with all tables and no rows to `path`. Migrations, 0.2 s, run once a process."""
    path.write_bytes(_migrated())
    return path


def empty_tables(cluster: Cluster, url: str) -> None:
    """Take all rows out of a migrated database, and begin anew."""
    tables = ", ".join(sorted(set(Table.metadata.tables) - {"store_state"}))
    with cluster.connect(url.partition("@/")[2].partition("?")[0]) as connection:
        connection.execute(f"TRUNCATE {tables} RESTART IDENTITY")
        connection.execute("UPDATE store_state SET revision = 0")


def filled(path: Path) -> Path:
    """A closed store of a few hundred pages."""
    with Store.open(make_file(path)) as store:
        for number in range(20):
            store.add_version("letter", {"noise": [os.urandom(500).hex() for _ in range(40)]}, "import")
            store.add_sample("letter", {"number": number})
    return path
