"""Stores of the first commit of each schema, made by the code of that time (`python -m benchmarks upgrade --write`)."""

import json
import sqlite3
import zipfile
from pathlib import Path
from typing import Any

import pytest
from alembic import command
from sqlalchemy import Engine, MetaData, Table, select

from app.review.decisions import place_of_stored
from benchmarks.common.postgresql import Cluster
from benchmarks.upgrade import ANSWERS, DATABASE
from models import session
from models.repository import Store
from tests.models.databases import KINDS

STORES = sorted((Path(__file__).parent / "old_stores").glob("*.zip"))
Rows = dict[str, list[dict[str, Any]]]


def unpacked(packed: Path, folder: Path) -> tuple[Path, dict[str, Any]]:
    """The old database, and what the old service had answered."""
    with zipfile.ZipFile(packed) as archive:
        return Path(archive.extract(DATABASE, folder)), json.loads(archive.read(ANSWERS))


def rows_of(engine: Engine, only: Rows | None = None) -> Rows:
    """All rows of all tables, in the order of their keys; only tables and columns that `only` has."""
    metadata = MetaData()
    metadata.reflect(engine)
    found: Rows = {}
    with engine.connect() as connection:
        for table in metadata.sorted_tables:
            if table.name == "alembic_version" or (only is not None and table.name not in only):
                continue
            kept = None if only is None or not only[table.name] else only[table.name][0].keys()
            columns = [column for column in table.columns if kept is None or column.name in kept]
            rows = connection.execute(select(*columns).order_by(*table.primary_key.columns)).mappings()
            found[table.name] = [{name: _plain(value) for name, value in row.items()} for row in rows]
    return found


def _plain(value: Any) -> Any:
    """Numbers of SQLite's columns of truth values are numbers, those of PostgreSQL are not."""
    return int(value) if isinstance(value, bool) else value


@pytest.mark.parametrize("packed", STORES, ids=lambda path: path.stem)
def test_everything_is_there_after_the_upgrade(packed: Path, tmp_path: Path) -> None:
    path, answers = unpacked(packed, tmp_path)
    engine = session.open_engine(path)
    before = rows_of(engine)
    engine.dispose()
    assert before["layout_samples"]
    assert before["layout_results"]
    with Store.open(path) as store:
        assert store.upgraded_from == answers["schema"].partition("-")[0]
        queued = store.queue_results(place_of_stored)
        assert queued == (0 if "layout_reviews" in before else len(before["layout_results"]))
        listed = store.reviews(100, order="gain")
        assert set(answers["open"]) <= {review.id for review in listed}
        missing = store.count_feedback_without_lessons()
        assert (missing > 0) == (packed.stem == "schema_0002-feedback")
        assert store.queue_results(place_of_stored) == 0
    engine = session.open_engine(path)
    after = rows_of(engine, only=before)
    engine.dispose()
    after["store_state"] = before["store_state"]  # how often models changed: new for caches
    assert {name: after[name] for name in before if name != "layout_reviews"} == {
        name: rows for name, rows in before.items() if name != "layout_reviews"
    }


@pytest.mark.skipif("postgresql" not in KINDS, reason="PostgreSQL is not installed")
@pytest.mark.parametrize("packed", STORES, ids=lambda path: path.stem)
def test_the_same_on_postgresql(packed: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """The rows of the old file, in tables that the migrations of that time make."""
    cluster: Cluster = request.getfixturevalue("cluster")
    fresh_url = cluster.make_database()
    path, answers = unpacked(packed, tmp_path)
    with sqlite3.connect(path) as file:
        [(revision,)] = file.execute("SELECT version_num FROM alembic_version")
    file.close()
    old, engine = session.open_engine(path), session.open_engine(fresh_url)
    config = session._alembic_config()
    with engine.connect() as connection, connection.begin():
        config.attributes["connection"] = connection
        command.upgrade(config, revision)
    before = _copied(old, engine)
    old.dispose()
    engine.dispose()
    with Store.open(fresh_url) as store:
        store.queue_results(place_of_stored)
        listed = store.reviews(100, order="gain")
        assert set(answers["open"]) <= {review.id for review in listed}
    engine = session.open_engine(fresh_url)
    after = rows_of(engine, only=before)
    engine.dispose()
    for name, rows in before.items():
        if name not in ("layout_reviews", "store_state"):
            assert after[name] == rows, name


def _copied(old: Engine, new: Engine) -> Rows:
    """Put the rows of one database into the equal tables of another one; the rows there."""
    metadata = MetaData()
    metadata.reflect(new)
    with old.connect() as source, new.connect() as target, target.begin():
        for table in metadata.sorted_tables:
            if table.name == "alembic_version":
                continue
            target.execute(table.delete())
            rows = [dict(row) for row in source.execute(select(_like(table))).mappings()]
            if rows:
                target.execute(table.insert(), rows)
    return rows_of(new)


def _like(table: Table) -> Table:
    """The table with its types, for another database."""
    return table.to_metadata(MetaData())
