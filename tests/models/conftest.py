"""A store on a real file, and on a real server where there is one, with a clock that moves when it is looked at."""

import itertools
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from benchmarks.common.postgresql import Cluster, running_cluster
from models.repository import Store
from tests.models.databases import KINDS, empty_tables, make_file


class Clock:
    """Times in UTC, a second later with every look."""

    def __init__(self) -> None:
        self.now = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)

    def __call__(self) -> datetime:
        self.now += timedelta(seconds=1)
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture(scope="session")
def cluster() -> Iterator[Cluster]:
    """A server of PostgreSQL; for tests that run where there is one."""
    with running_cluster() as cluster:
        yield cluster


@pytest.fixture(scope="session")
def emptied_url(cluster: Cluster) -> str:
    """A database with all tables, from which `where` takes the rows before every test."""
    url = cluster.make_database()
    Store.open(url).close()
    return url


@pytest.fixture(params=KINDS)
def where(request: pytest.FixtureRequest, tmp_path: Path) -> Path | str:
    """What to open: a file or a database with all tables and no rows."""
    if request.param == "sqlite":
        return make_file(tmp_path / "store.sqlite3")
    url: str = request.getfixturevalue("emptied_url")
    empty_tables(request.getfixturevalue("cluster"), url)
    return url


@pytest.fixture(params=KINDS)
def fresh(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[[], Path | str]:
    """Makes what to open: files that are not there yet, or databases without tables."""
    if request.param == "sqlite":
        names = itertools.count()
        return lambda: tmp_path / f"fresh-{next(names)}" / "store.sqlite3"
    cluster: Cluster = request.getfixturevalue("cluster")
    return cluster.make_database


@pytest.fixture
def store(where: Path | str, clock: Clock) -> Iterator[Store]:
    with Store.open(where, clock=clock) as store:
        yield store


@pytest.fixture
def letters(store: Store) -> Store:
    """A store with the classes letter, memo (both in version 1) and fax (one sample, no version)."""
    store.add_version("letter", {"n": 1}, "import")
    store.add_version("memo", {"n": 1}, "import")
    store.add_sample("fax", {"n": 1})
    return store


@pytest.fixture
def result(letters: Store) -> str:
    return letters.add_result({"page": "the page"}, ttl_s=1000)
