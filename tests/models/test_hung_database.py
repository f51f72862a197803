"""A database that stops answering, and a file that is gone: calls end in time, and go on when it is back."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.common.postgresql import Cluster, running_cluster
from models import session
from models.errors import StoreUnavailable
from models.repository import Store
from tests.models.databases import KINDS, filled


@pytest.fixture(scope="module")
def own_cluster() -> Iterator[Cluster]:
    """A server of this module's own, because it is stopped."""
    if "postgresql" not in KINDS:
        pytest.skip("no server of PostgreSQL is installed")
    with running_cluster() as cluster:
        yield cluster


def test_a_server_that_hangs(own_cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    """It accepts connections and keeps those that it has, and answers none. The driver waits for ever by default."""
    monkeypatch.setattr("models.session._ANSWER_TIMEOUT_S", 0.5)
    with Store.open(own_cluster.make_database(), busy_timeout_s=0.5) as store:
        before = store.revision()
        with own_cluster.hung():
            for _ in range(2):  # the connection that was there, and a new one
                begin = time.monotonic()
                with pytest.raises(StoreUnavailable):
                    store.revision()
                assert time.monotonic() - begin < 12  # two of connect_timeout, which is 5 s
        assert store.revision() == before
        store.add_version("letter", {"n": 1}, "import")
        assert store.revision() == before + 1


def test_a_file_that_is_deleted(tmp_path: Path) -> None:
    """Its connections still work, and what they write would be lost."""
    path = filled(tmp_path / "store.sqlite3")
    with Store.open(path) as store:
        path.rename(tmp_path / "elsewhere")
        for _ in range(3):
            with pytest.raises(StoreUnavailable):
                store.revision()
            with pytest.raises(StoreUnavailable):
                store.add_version("letter", {"n": 1}, "import")
        assert not path.exists()  # no empty one in its place
        (tmp_path / "elsewhere").rename(path)
        assert store.revision() > 0


def test_a_log_that_is_moved_away(tmp_path: Path) -> None:
    """What is written to it is in no database that anybody opens later."""
    path = filled(tmp_path / "store.sqlite3")
    log, away = path.with_name(f"{path.name}-wal"), tmp_path / "away"
    with Store.open(path) as store:
        store.add_version("letter", {"n": 1}, "import")
        log.rename(away)
        for _ in range(2):
            with pytest.raises(StoreUnavailable, match=r"store\.sqlite3-wal"):
                store.revision()
            with pytest.raises(StoreUnavailable, match=r"store\.sqlite3-wal"):
                store.add_version("letter", {"n": 2}, "import")
        assert not log.exists()  # no empty one in its place
        away.rename(log)
        before = store.revision()
        store.add_version("letter", {"n": 2}, "import")
    with Store.open(path) as store:  # the last connection has deleted the log, a new one is made
        assert store.revision() == before + 1
        store.add_version("letter", {"n": 3}, "import")


def test_a_log_that_is_made_again_when_nothing_is_open(tmp_path: Path) -> None:
    path = filled(tmp_path / "store.sqlite3")
    engine = session.open_engine(path)
    for _ in range(2):
        with engine.connect() as connection:
            connection.exec_driver_sql("SELECT 1 FROM layout_models")
            connection.invalidate()  # closes the only connection
    engine.dispose()


def test_a_file_that_is_replaced(tmp_path: Path) -> None:
    path, other = filled(tmp_path / "store.sqlite3"), filled(tmp_path / "other.sqlite3")
    with Store.open(path) as store:
        other.replace(path)
        with pytest.raises(StoreUnavailable, match="replaced"):
            store.revision()
