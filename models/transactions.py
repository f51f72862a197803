"""The transactions of all calls of the store, and opening and closing the database."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

from sqlalchemy import delete, func, select
from sqlalchemy.orm import InstrumentedAttribute, Session

from models.errors import StoreUnavailable
from models.session import (
    BUSY_TIMEOUT_S,
    WriterLock,
    check_intact,
    glances_of,
    open_engine,
    storage_errors,
    upgrade_schema,
    writers_of,
)
from models.tables import AuditRow, StateRow
from models.ulid import UlidFactory

MOST_AUDIT = 100_000
"""Entries of the list of changes; the oldest are deleted first."""


@dataclass(frozen=True, slots=True)
class Author:
    """Who changes something: the name of an API key (None: no key), and what that request does."""

    who: str | None
    action: str


_AUTHOR: ContextVar[Author | None] = ContextVar("author", default=None)


@contextmanager
def changes_by(author: Author) -> Iterator[None]:
    """What calls of the store change inside of the block is listed as changes of `author`."""
    before = _AUTHOR.set(author)
    try:
        yield
    finally:
        _AUTHOR.reset(before)


def utc_now() -> datetime:
    """The current time in UTC, aware."""
    return datetime.now(UTC)


class Transactions:
    """An open database and its transactions; `models.repository.Store` has the calls."""

    @classmethod
    def open(
        cls,
        where: Path | str,
        *,
        busy_timeout_s: float = BUSY_TIMEOUT_S,
        clock: Callable[[], datetime] = utc_now,
    ) -> Self:
        """Open the SQLite file `where` (created if missing) or the database of a URL, and run missing migrations.

        Raises `StoreTooNew`, `StoreDamaged`, and `StoreUnavailable` for every other failure.
        """
        return cls(where, busy_timeout_s, clock)

    def __init__(self, where: Path | str, busy_timeout_s: float, clock: Callable[[], datetime]) -> None:
        self._clock = clock
        self._ulids = UlidFactory()
        self._closed = False
        self._readers = open_engine(where, busy_timeout_s)
        self._glances = glances_of(self._readers)
        self._writers = writers_of(self._readers)
        self._writer_lock = WriterLock(self._readers, busy_timeout_s)
        try:
            check_intact(self._readers)
            self.upgraded_from = upgrade_schema(self._readers)
            """The schema of an older release, if this call has brought it up to date; else None."""
        except BaseException:
            self._readers.dispose()
            raise

    def close(self) -> None:
        """Close the connections. Every later call raises `StoreUnavailable`."""
        self._closed = True
        self._readers.dispose()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @contextmanager
    def _reading(self) -> Iterator[Session]:
        """A read-only transaction; it sees one state of the database."""
        if self._closed:
            raise StoreUnavailable("the store is closed")
        with storage_errors(), Session(self._readers, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def _glancing(self) -> Iterator[Session]:
        """For reading by one statement: on PostgreSQL one exchange with the server in place of three."""
        if self._closed:
            raise StoreUnavailable("the store is closed")
        with storage_errors(), Session(self._glances, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def _writing(self) -> Iterator[Session]:
        """A transaction that commits at the end of the block, and rolls back on an exception.

        On PostgreSQL others may write between its statements: see `_changing`.
        """
        if self._closed:
            raise StoreUnavailable("the store is closed")
        with (
            self._writer_lock.hold(),
            storage_errors(),
            Session(self._writers, expire_on_commit=False) as session,
            session.begin(),
        ):
            yield session

    @contextmanager
    def _changing(self) -> Iterator[tuple[Session, StateRow]]:
        """A `_writing` transaction that reads what its writes depend on. Only one runs at a time, on every database.

        Calls that use `_writing` alone write by one statement with its condition, or lock each row that they read.
        """
        with self._writing() as session:
            yield session, session.get_one(StateRow, 1, with_for_update=True)

    def _new_ids(
        self, session: Session, column: InstrumentedAttribute[str], now: datetime, count: int = 1
    ) -> list[str]:
        """Ids for rows of a table, larger than those that are there: in the order of arrival, whatever clocks say.

        For `_changing` transactions.
        """
        newest = session.execute(select(func.max(column))).scalar_one()
        return [self._ulids.make(now, newest) for _ in range(count)]

    def _list_changes(self, session: Session, models: Iterable[str], detail: str) -> None:
        """List the same change of several models; of none: one entry without a model."""
        names: list[str | None] = [*sorted(models)]
        for name in names or [None]:
            self._list_change(session, name, detail)

    def _list_change(self, session: Session, model: str | None, detail: str = "") -> None:
        """Add a change to the list of changes, in the transaction that makes it.

        Nothing is listed outside of `changes_by`: the service itself deletes what has expired.
        """
        author = _AUTHOR.get()
        if author is None:
            return
        now = self._clock()
        session.add(
            AuditRow(
                id=self._new_ids(session, AuditRow.id, now)[0],
                created_at=now,
                who=author.who,
                action=author.action,
                model=model,
                detail=detail,
            )
        )
        session.flush()
        oldest = select(AuditRow.id).order_by(AuditRow.id.desc()).offset(MOST_AUDIT).limit(1)
        last = session.execute(oldest).scalar_one_or_none()
        if last is not None:
            session.execute(delete(AuditRow).where(AuditRow.id <= last))
