"""Connections to the database: opening, transactions, and migration of the schema.

On SQLite many processes may write. It uses a write-ahead log, and every commit is on the disk before the call returns.
A writer takes the lock at its start (BEGIN IMMEDIATE): a transaction that becomes a writer later fails when another
one wrote in between. Readers never wait. On PostgreSQL too a reader sees one state of the database (REPEATABLE READ).
Writers queue for a row that they lock first (READ COMMITTED: they see the last commit).
"""

import errno
import math
import sqlite3
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, Final, cast

import psycopg
from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import URL, Connection, Dialect, Engine, create_engine, event, inspect, make_url, text
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import (
    ArgumentError,
    DataError,
    DBAPIError,
    DisconnectionError,
    NoSuchModuleError,
    SQLAlchemyError,
)
from sqlalchemy.pool import ConnectionPoolEntry

from models.bounded_connection import bounded
from models.errors import NotStorable, StoreDamaged, StoreTooNew, StoreUnavailable
from models.private_files import make_database, make_folder
from models.tables import Table

BUSY_TIMEOUT_S = 10.0
"""Longest wait of a writer for the lock. A write takes 5 ms, but waiting processes poll the lock: one of 1000 writes of
four busy processes waited 3 s on a shared disk."""
_ANSWER_TIMEOUT_S = 5.0
"""Longest wait for PostgreSQL, in addition to that for a lock: the longest statement takes 0.3 s."""
_CONNECTION_SETTINGS = {
    "connect_timeout": "5",
    "keepalives_idle": "30",
    "keepalives_interval": "10",
    "keepalives_count": "3",
    "tcp_user_timeout": "15000",
}
"""libpq's settings by which a dead connection is noticed; those in the URL come first."""
_POOL_SIZE, _POOL_OVERFLOW = 8, 32
"""Connections that stay open, and additional ones under load: 40 in all, the number of anyio's threads."""
_PING_AFTER_S = 1.0
"""Idle time after which a connection is tried before it is used: the server may have restarted. A call whose connection
broke meanwhile fails as unavailable, and the next one has a new connection."""
_IDLE_SINCE_S: Final = "idle_since_s"
_POSTGRESQL: Final = "postgresql+psycopg"
_WRITER: Final = "store_writer"
_MIGRATION_LOCK = 0x6C61796F75746D  # key of PostgreSQL's advisory lock: any number that no other program uses
_migrating = threading.Lock()  # alembic has global state
_PRAGMAS = (
    "PRAGMA synchronous=FULL",
    "PRAGMA foreign_keys=ON",
    "PRAGMA trusted_schema=OFF",
    # The log file shrinks to this size after a peak.
    "PRAGMA journal_size_limit=67108864",
)


def open_engine(where: Path | str, busy_timeout_s: float = BUSY_TIMEOUT_S) -> Engine:
    """An engine for an SQLite file (for its owner only; made with its folder if missing) or for a database's URL."""
    url = _url_of(where)
    with storage_errors():
        if url.get_backend_name() == "postgresql":
            return _open_postgresql(url, busy_timeout_s)
        if url.get_backend_name() != "sqlite":
            raise StoreUnavailable("the database is neither SQLite nor PostgreSQL")
        if not url.database or url.database == ":memory:":
            raise StoreUnavailable("SQLite needs a file: without one nothing would be remembered")
        make_folder(Path(url.database).parent)
        make_database(Path(url.database))
        engine = create_engine(
            url,
            hide_parameters=True,
            connect_args={"timeout": busy_timeout_s},
            pool_size=_POOL_SIZE,
            max_overflow=_POOL_OVERFLOW,
            pool_timeout=busy_timeout_s,
        )
    file = _DatabaseFile(Path(url.database))

    @event.listens_for(engine, "do_connect")
    @event.listens_for(engine, "checkout")
    def check_file(*_: object) -> None:
        file.check()  # before a connection, which would make an empty file

    @event.listens_for(engine, "connect")
    def prepare(connection: sqlite3.Connection, _: object) -> None:
        connection.isolation_level = None  # `begin` below starts transactions, not the driver
        _enter_wal(connection, busy_timeout_s)
        for pragma in _PRAGMAS:
            connection.execute(pragma)
        file.opened(connection)

    @event.listens_for(engine, "close")
    @event.listens_for(engine, "close_detached")
    def forget(connection: sqlite3.Connection, *_: object) -> None:
        file.closed(connection)

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        is_writer = connection.get_execution_options().get(_WRITER, False)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if is_writer else "BEGIN")

    return engine


class _DatabaseFile:
    """The files of SQLite: the database and its log. Connections to files that were deleted or moved away still work.

    What they write is lost. SQLite itself deletes the log when the last connection closes.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._log = path, path.with_name(f"{path.name}-wal")
        self._lock = threading.Lock()
        self._open: set[int] = set()
        self._identity: tuple[int, int] | None = None
        self._log_identity: tuple[int, int] | None = None

    def opened(self, connection: sqlite3.Connection) -> None:
        """Take the files that are there for the database and its log, if none were taken before."""
        with self._lock:
            self._open.add(id(connection))
            self._identity = self._identity or _identity(self._path)
            self._log_identity = self._log_identity or _identity(self._log)

    def closed(self, connection: sqlite3.Connection) -> None:
        """Without connections the log may be deleted and made again; one that was moved away stays missed."""
        with self._lock:
            self._open.discard(id(connection))
            if not self._open and self._log_identity == _identity(self._log):
                self._log_identity = None

    def check(self) -> None:
        """Raise `FileNotFoundError` when a file was deleted or replaced."""
        if self._identity is not None and self._identity != _identity(self._path):
            raise FileNotFoundError(
                errno.ENOENT, "the file was moved or replaced; put it back, or restart the service"
            )
        log = self._log_identity
        if log is not None and log != _identity(self._log):
            raise FileNotFoundError(
                errno.ENOENT,
                f"{self._log.name} with the newest data was moved or deleted; put it back, and restart the service",
            )


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and inode of a file; None where there is none."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_dev, status.st_ino


def _open_postgresql(url: URL, busy_timeout_s: float) -> Engine:
    engine = create_engine(
        url,
        hide_parameters=True,
        connect_args={key: value for key, value in _CONNECTION_SETTINGS.items() if key not in url.query},
        isolation_level="REPEATABLE READ",
        pool_size=_POOL_SIZE,
        max_overflow=_POOL_OVERFLOW,
        pool_timeout=busy_timeout_s,
    )
    connection_class = bounded(busy_timeout_s + _ANSWER_TIMEOUT_S)

    @event.listens_for(engine, "do_connect")
    def connect(
        _: Dialect, __: object, arguments: Sequence[Any], settings: dict[str, Any]
    ) -> DBAPIConnection:
        return cast(DBAPIConnection, connection_class.connect(*arguments, **settings))

    @event.listens_for(engine, "connect")
    def prepare(connection: DBAPIConnection, _: object) -> None:
        cursor = connection.cursor()
        cursor.execute(f"SET lock_timeout = {max(1, round(busy_timeout_s * 1000))}")
        cursor.close()
        connection.commit()

    @event.listens_for(engine, "checkin")
    def note(_: DBAPIConnection | None, record: ConnectionPoolEntry) -> None:
        record.info[_IDLE_SINCE_S] = time.monotonic()

    @event.listens_for(engine, "checkout")
    def ping(connection: DBAPIConnection, record: ConnectionPoolEntry, _: object) -> None:
        if time.monotonic() - record.info.get(_IDLE_SINCE_S, math.inf) > _PING_AFTER_S:
            try:
                engine.dialect.do_ping(connection)
            except psycopg.Error as error:
                raise DisconnectionError from error  # the pool makes a new connection

    return engine


def writers_of(engine: Engine) -> Engine:
    """An engine with the same connections, for transactions that write."""
    if engine.dialect.name == "postgresql":
        return engine.execution_options(isolation_level="READ COMMITTED")
    return engine.execution_options(**{_WRITER: True})


def glances_of(engine: Engine) -> Engine:
    """An engine with the same connections, for reading by one statement, which needs no transaction of its own."""
    if engine.dialect.name == "postgresql":
        return engine.execution_options(isolation_level="AUTOCOMMIT")
    return engine


class WriterLock:
    """A lock for the threads of one process that write to SQLite: they wait for it instead of polling the database.

    With 32 threads that write at once it gives 2000 writes a second instead of 700, and a 99th percentile of 36 ms
    instead of 350 ms. Different processes still poll. Other databases have queues of their own.
    """

    def __init__(self, engine: Engine, timeout_s: float) -> None:
        self._lock = threading.Lock() if engine.dialect.name == "sqlite" else None
        self._timeout_s = timeout_s

    @contextmanager
    def hold(self) -> Iterator[None]:
        """Hold the lock. Raises `StoreUnavailable` after the timeout."""
        if self._lock is None:
            yield
            return
        if not self._lock.acquire(timeout=self._timeout_s):
            raise StoreUnavailable("the database is locked: too many wait to write")
        try:
            yield
        finally:
            self._lock.release()


def check_intact(engine: Engine) -> None:
    """Raises `StoreDamaged` when SQLite's integrity check fails. It reads the whole file (100 MB in about 0.1 s)."""
    if engine.dialect.name != "sqlite":
        return
    with storage_errors(), engine.connect() as connection:
        verdict = connection.exec_driver_sql("PRAGMA quick_check(1)").scalar_one()
    if verdict != "ok":
        raise StoreDamaged(f"the database is damaged: {verdict}")


def upgrade_schema(engine: Engine) -> str | None:
    """Run the missing migrations in one transaction; the version before, None if there was none, or nothing to do.

    Of several processes only one runs them.

    Raises `StoreTooNew` when the database has migrations that this release does not know.
    """
    with _migrating, storage_errors():
        config = _alembic_config()
        script = ScriptDirectory.from_config(config)
        with engine.connect() as connection:
            if _revision_of(connection, script) == script.get_current_head():
                return None
        with writers_of(engine).connect() as connection:
            connection.detach()  # settings for the migration end with this connection
            if engine.dialect.name == "sqlite":
                # Batch mode drops tables that others refer to. This pragma has no effect inside a transaction.
                driver: Any = connection.connection.dbapi_connection
                driver.execute("PRAGMA foreign_keys=OFF")
            with connection.begin():
                if engine.dialect.name == "postgresql":
                    connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _MIGRATION_LOCK})
                return _migrate(connection, config, script)


def _migrate(connection: Connection, config: Config, script: ScriptDirectory) -> str | None:
    """Run the migrations under the lock, if no other process ran them during the wait; the version before."""
    before = _revision_of(connection, script)
    if before is None:
        ours = set(inspect(connection).get_table_names()) & set(Table.metadata.tables)
        if ours:
            raise StoreDamaged(f"the database has the tables {', '.join(sorted(ours))} and no version")
    config.attributes["connection"] = connection
    command.upgrade(config, "head")
    if connection.dialect.name == "sqlite" and connection.exec_driver_sql("PRAGMA foreign_key_check").first():
        raise StoreDamaged("rows refer to others that are not there")
    return None if before == script.get_current_head() else before


def _revision_of(connection: Connection, script: ScriptDirectory) -> str | None:
    current = MigrationContext.configure(connection).get_current_revision()
    known = {entry.revision for entry in script.walk_revisions()}
    if current is not None and current not in known:
        raise StoreTooNew(
            f"the database is of version {current}, this release knows {script.get_current_head()} at most: "
            "please run the newer release"
        )
    return current


def _alembic_config() -> Config:
    config = Config()
    (folder,) = import_module("models.migrations").__path__
    # A percent sign has a special meaning in alembic's settings.
    config.set_main_option("script_location", folder.replace("%", "%%"))
    return config


@contextmanager
def storage_errors() -> Iterator[None]:
    """Convert errors of the database and the disk to errors of the store."""
    try:
        yield
    except DBAPIError as error:
        kind = getattr(error.orig, "sqlite_errorname", "")
        if kind.startswith(("SQLITE_CORRUPT", "SQLITE_NOTADB")):
            raise StoreDamaged(f"the database is damaged: {error.orig}") from error
        if isinstance(
            error, DataError
        ):  # PostgreSQL accepts no NUL in a text, and no number beyond its column
            raise NotStorable("a value has characters or a size that the database cannot hold") from error
        raise StoreUnavailable(f"the database cannot be used: {error.orig}") from error
    except SQLAlchemyError as error:
        raise StoreUnavailable(f"the database cannot be used: {error}") from error
    except ImportError as error:
        raise StoreUnavailable(f"the driver of this database is not installed: {error}") from error
    except OSError as error:
        raise StoreUnavailable(f"the database cannot be used: {error.strerror or error}") from error


def _url_of(where: Path | str) -> URL:
    if isinstance(where, Path) or "://" not in where:
        return URL.create("sqlite", database=str(where))
    try:
        url = make_url(where)
        if url.drivername in ("postgres", "postgresql"):
            url = url.set(drivername=_POSTGRESQL)
        url.get_dialect()
    except (ArgumentError, NoSuchModuleError) as error:
        raise StoreUnavailable("the URL of the database is not one, or its dialect is not known") from error
    return url


def _enter_wal(connection: sqlite3.Connection, timeout_s: float) -> None:
    """Switch to the write-ahead log. SQLite does not wait here for another process, so this function retries."""
    deadline = time.monotonic() + timeout_s
    while True:
        try:
            connection.execute("PRAGMA journal_mode=WAL")
            return
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or time.monotonic() > deadline:
                raise
        time.sleep(0.01)
