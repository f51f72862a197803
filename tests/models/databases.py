"""The databases that the store's promises are tested on: SQLite, and PostgreSQL where its server is installed."""

import os
from pathlib import Path

from benchmarks.common.postgresql import IS_INSTALLED, Cluster
from models.repository import Store
from models.tables import Table

PAGE = 4096
"""Bytes of a page of SQLite's file."""
KINDS = ("sqlite", "postgresql") if IS_INSTALLED else ("sqlite",)


def empty_tables(cluster: Cluster, url: str) -> None:
    """Take all rows out of a migrated database, and begin anew."""
    tables = ", ".join(sorted(set(Table.metadata.tables) - {"store_state"}))
    with cluster.connect(url.partition("@/")[2].partition("?")[0]) as connection:
        connection.execute(f"TRUNCATE {tables} RESTART IDENTITY")
        connection.execute("UPDATE store_state SET revision = 0")


def filled(path: Path) -> Path:
    """A closed store of a few hundred pages."""
    with Store.open(path) as store:
        for number in range(20):
            store.add_version("letter", {"noise": [os.urandom(500).hex() for _ in range(40)]}, "import")
            store.add_sample("letter", {"number": number})
    return path
