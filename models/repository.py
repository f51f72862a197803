"""What is remembered of layout recognition: the only door to the database.

Every call is one short transaction, and may be made from any thread. Calls that write take their turn, on every
database: what one of them reads is what it changes.

**Versions** of a model count 1, 2, 3 and are never used again. Deleting a class drops its samples at once (they are
somebody's pages) and hides its versions; a class made anew under that name goes on counting, and its history shows
the earlier versions again. So a document never changes under its (name, version), and may be cached by it.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Self, cast

from sqlalchemy import ColumnElement, CursorResult, delete, func, select
from sqlalchemy.orm import Session

from models.documents import Document, decode_document, digest_document, encode_document
from models.errors import (
    KeyReused,
    ModelNotFound,
    NotStorable,
    ResultNotFound,
    StoreFull,
    StoreUnavailable,
)
from models.queries import (
    count_samples,
    find_model,
    find_sample,
    is_storable,
    is_text,
    look_up_model,
    require_storable,
    require_version,
    stored_model,
    stored_sample,
)
from models.records import (
    ANY,
    ExpectedVersion,
    ModelSummary,
    Origin,
    StoredModel,
    StoredResult,
    StoredSample,
    VersionSummary,
)
from models.session import (
    BUSY_TIMEOUT_S,
    WriterTurns,
    check_intact,
    open_engine,
    storage_errors,
    upgrade_schema,
    writers_of,
)
from models.tables import MAX_NAME, ModelRow, ResultRow, SampleRow, StateRow, VersionRow
from models.ulid import UlidFactory, is_ulid

_MAX_VERSION = 2**31 - 1  # of the column
_READ_AT_ONCE = 8
"""Rows of documents, each of some MB at most."""


def utc_now() -> datetime:
    """The time, aware."""
    return datetime.now(UTC)


class Store:
    """Models, samples and results in one database; `with Store.open(...)` closes it."""

    @classmethod
    def open(
        cls,
        where: Path | str,
        *,
        busy_timeout_s: float = BUSY_TIMEOUT_S,
        clock: Callable[[], datetime] = utc_now,
    ) -> Self:
        """Open the SQLite file `where` (made when absent) or the database of a URL, and bring it up to date.

        `StoreTooNew`, `StoreDamaged` or, for all else that stands in the way, `StoreUnavailable`.
        """
        return cls(where, busy_timeout_s, clock)

    def __init__(self, where: Path | str, busy_timeout_s: float, clock: Callable[[], datetime]) -> None:
        self._clock = clock
        self._ulids = UlidFactory()
        self._closed = False
        self._readers = open_engine(where, busy_timeout_s)
        self._writers = writers_of(self._readers)
        self._turns = WriterTurns(self._readers, busy_timeout_s)
        try:
            check_intact(self._readers)
            upgrade_schema(self._readers)
        except BaseException:
            self._readers.dispose()
            raise

    def close(self) -> None:
        """Give the connections back; every later call is `StoreUnavailable`."""
        self._closed = True
        self._readers.dispose()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # Models

    def revision(self) -> int:
        """Grows with every version, new class and deletion: while it stays, `ready_models` stays."""
        with self._reading() as session:
            return session.execute(select(StateRow.revision)).scalar_one()

    def models(self) -> list[ModelSummary]:
        """All document classes, by name."""
        with self._reading() as session:
            rows = session.execute(select(ModelRow, count_samples()).where(ModelRow.deleted_at.is_(None)))
            return sorted(
                (
                    ModelSummary(row.name, row.version, samples, row.created_at, row.updated_at)
                    for row, samples in rows
                ),
                key=lambda summary: summary.name,
            )

    def model(self, name: str, version: int | None = None) -> StoredModel:
        """A class with its newest version, or with an earlier one; `ModelNotFound`."""
        with self._reading() as session:
            row = find_model(session, name)
            version = row.version if version is None else version
            samples = session.execute(select(count_samples()).where(ModelRow.id == row.id)).scalar_one()
            if version is None:
                return stored_model(row, samples, None)
            found = session.get(VersionRow, (row.id, version)) if 0 < version <= _MAX_VERSION else None
        if found is None:
            raise ModelNotFound(f"the model {name!r} has no version {version}", name)
        return stored_model(row, samples, found)

    def ready_models(self, names: Sequence[str] | None = None) -> list[StoredModel]:
        """The newest version of every class (or of those named) that has one, by name; `ModelNotFound`."""
        return list(self.each_ready_model(names))

    def each_ready_model(self, names: Sequence[str] | None = None) -> Iterator[StoredModel]:
        """The same one after another, so that one document alone is unpacked at a time."""
        if names is not None and not names:
            return
        wanted = select(ModelRow, count_samples(), VersionRow).where(ModelRow.deleted_at.is_(None))
        wanted = wanted.outerjoin(
            VersionRow, (VersionRow.model_id == ModelRow.id) & (VersionRow.version == ModelRow.version)
        )
        if names is not None:
            wanted = wanted.where(ModelRow.name.in_({name for name in names if is_storable(name)}))
        with self._reading() as session:
            rows = session.execute(wanted).all()
        missing = [name for name in names or () if name not in {row.name for row, _, _ in rows}]
        if missing:
            raise ModelNotFound(f"there is no model {missing[0]!r}", missing[0])
        for row, samples, found in sorted(rows, key=lambda each: each[0].name):
            if found is not None:
                yield stored_model(row, samples, found)

    def model_versions(self, name: str) -> list[VersionSummary]:
        """The history of a class, oldest first; `ModelNotFound`."""
        with self._reading() as session:
            row = find_model(session, name)
            rows = session.execute(
                select(VersionRow.version, VersionRow.origin, VersionRow.created_at, VersionRow.note)
                .where(VersionRow.model_id == row.id)
                .order_by(VersionRow.version)
            ).all()
        return [
            VersionSummary(version, cast(Origin, origin), created_at, note)
            for version, origin, created_at, note in rows
        ]

    def add_version(
        self,
        name: str,
        document: Document,
        origin: Origin,
        *,
        expected_version: ExpectedVersion = ANY,
        note: str = "",
        max_models: int | None = None,
    ) -> StoredModel:
        """Make `document` the newest version of a class; an import creates the class (`StoreFull` at the bound).

        `VersionConflict` when the class has another version than expected, `ModelNotFound`, `NotStorable`.
        """
        require_storable(name, "name")
        packed = encode_document(document)
        if len(note) > 10 * MAX_NAME or not is_text(note):
            raise NotStorable("the note is too long, or has characters that cannot be kept")
        with self._changing() as (session, state):
            row = look_up_model(session, name)
            if row is None and origin != "import":
                raise ModelNotFound(f"there is no model {name!r}", name)
            require_version(name, None if row is None else row.version, expected_version)
            now = self._clock()
            if row is None:
                row = self._create_model(session, name, now, max_models)
            row.last_version += 1
            row.version, row.updated_at = row.last_version, now
            state.revision += 1
            version = VersionRow(
                model_id=row.id,
                version=row.version,
                origin=origin,
                note=note,
                created_at=now,
                document=packed,
            )
            session.add(version)
            session.flush()
            samples = session.execute(select(count_samples()).where(ModelRow.id == row.id)).scalar_one()
        return stored_model(row, samples, version)

    def delete_model(self, name: str, *, expected_version: ExpectedVersion = ANY) -> None:
        """Delete a class and its samples; `ModelNotFound`, `VersionConflict`."""
        with self._changing() as (session, state):
            row = find_model(session, name)
            require_version(name, row.version, expected_version)
            session.execute(delete(SampleRow).where(SampleRow.model_id == row.id))
            row.deleted_at = row.updated_at = self._clock()
            row.version = None
            state.revision += 1

    # Samples

    def add_sample(
        self,
        name: str,
        document: Document,
        *,
        key: str | None = None,
        max_samples: int | None = None,
        max_models: int | None = None,
    ) -> StoredSample:
        """Add a labelled page to a class, which its first sample creates.

        The same key or the same content counts once: the answer is then the first sample, with `created` False.
        `KeyReused` when a key comes with another content, `StoreFull` at a bound, `NotStorable`.
        """
        require_storable(name, "name")
        if key is not None:
            require_storable(key, "key")
        packed, digest = encode_document(document), digest_document(document)
        with self._changing() as (session, state):
            now = self._clock()
            row = look_up_model(session, name)
            if row is None:
                row = self._create_model(session, name, now, max_models)
                state.revision += 1
            of_model = select(SampleRow).where(SampleRow.model_id == row.id)
            if key is not None:
                earlier = session.execute(of_model.where(SampleRow.key == key)).scalar_one_or_none()
                if earlier is not None and earlier.digest != digest:
                    raise KeyReused(f"the idempotency key {key!r} came before, with another sample")
            same = session.execute(of_model.where(SampleRow.digest == digest)).scalar_one_or_none()
            if same is not None:
                return stored_sample(same, created=False)
            count = session.execute(select(count_samples()).where(ModelRow.id == row.id)).scalar_one()
            if max_samples is not None and count >= max_samples:
                raise StoreFull(f"the model {name!r} has {count} samples, {max_samples} are allowed")
            row.updated_at = now
            sample = SampleRow(
                id=self._ulids.make(now),
                model_id=row.id,
                key=key,
                digest=digest,
                created_at=now,
                document=packed,
            )
            session.add(sample)
            session.flush()
            return stored_sample(sample, created=True)

    def samples(self, name: str) -> list[StoredSample]:
        """All samples of a class with their documents, oldest first; `ModelNotFound`."""
        with self._reading() as session:
            row = find_model(session, name)
            of_model = select(SampleRow).where(SampleRow.model_id == row.id).order_by(SampleRow.id)
            rows = session.execute(of_model).scalars().all()
        return [stored_sample(sample, created=False) for sample in rows]

    def each_sample(self, name: str, *, newest_first: bool = False) -> Iterator[StoredSample]:
        """The same one after another, so that never all are in memory; `ModelNotFound` at the first."""
        with self._reading() as session:
            row = find_model(session, name)
            order = SampleRow.id.desc() if newest_first else SampleRow.id
            wanted = select(SampleRow).where(SampleRow.model_id == row.id).order_by(order)
            for sample in session.execute(wanted.execution_options(yield_per=_READ_AT_ONCE)).scalars():
                yield stored_sample(sample, created=False)
                session.expunge(sample)

    def sample(self, name: str, sample_id: str) -> StoredSample:
        """One sample of a class; `ModelNotFound`, `SampleNotFound`."""
        with self._reading() as session:
            return stored_sample(find_sample(session, name, sample_id), created=False)

    def sample_count(self, name: str) -> int:
        """How many samples a class has; `ModelNotFound`."""
        return self.model_summary(name).samples

    def model_summary(self, name: str) -> ModelSummary:
        """A class without its document; `ModelNotFound`."""
        with self._reading() as session:
            row = find_model(session, name)
            samples = session.execute(select(count_samples()).where(ModelRow.id == row.id)).scalar_one()
        return ModelSummary(row.name, row.version, samples, row.created_at, row.updated_at)

    def delete_sample(self, name: str, sample_id: str) -> None:
        """Take a sample away from a class, which stays; `ModelNotFound`, `SampleNotFound`."""
        with self._changing() as (session, _):
            session.delete(find_sample(session, name, sample_id))
            find_model(session, name).updated_at = self._clock()

    # Results

    def add_result(self, document: Document, ttl_s: float) -> str:
        """Keep the answer to a recognition for `ttl_s` seconds; its id is handed out."""
        packed, now = encode_document(document), self._clock()
        row = ResultRow(
            id=self._ulids.make(now),
            created_at=now,
            expires_at=now + timedelta(seconds=ttl_s),
            document=packed,
        )
        with self._writing() as session:
            session.add(row)
        return row.id

    def result(self, result_id: str) -> StoredResult:
        """An answer that is still kept; `ResultNotFound`."""
        with self._reading() as session:
            row = session.get(ResultRow, result_id) if is_ulid(result_id) else None
        if row is None or row.expires_at <= self._clock():
            raise ResultNotFound(f"there is no result {result_id!r}, or no longer", result_id)
        return StoredResult(row.id, decode_document(row.document), row.created_at, row.expires_at)

    def purge_results(self, now: datetime | None = None, keep_newest: int | None = None) -> int:
        """Delete what has expired by `now` (aware) and all but the newest; how many went."""
        gone: ColumnElement[bool] = ResultRow.expires_at <= (now or self._clock())
        with self._writing() as session:
            if keep_newest is not None:
                newest = select(ResultRow.id).order_by(ResultRow.id.desc()).offset(keep_newest).limit(1)
                last = session.execute(newest).scalar_one_or_none()
                if last is not None:
                    gone |= ResultRow.id <= last
            return cast(CursorResult[None], session.execute(delete(ResultRow).where(gone))).rowcount

    # Transactions

    @contextmanager
    def _reading(self) -> Iterator[Session]:
        """A transaction that sees one state of the database and changes nothing."""
        if self._closed:
            raise StoreUnavailable("the store is closed")
        with storage_errors(), Session(self._readers, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def _writing(self) -> Iterator[Session]:
        """A transaction that is kept when the block ends well, and leaves no trace when it does not."""
        if self._closed:
            raise StoreUnavailable("the store is closed")
        with (
            self._turns.take(),
            storage_errors(),
            Session(self._writers, expire_on_commit=False) as session,
            session.begin(),
        ):
            yield session

    @contextmanager
    def _changing(self) -> Iterator[tuple[Session, StateRow]]:
        """`_writing` for models and samples: one at a time."""
        with self._writing() as session:
            yield session, session.get_one(StateRow, 1, with_for_update=True)

    def _create_model(self, session: Session, name: str, now: datetime, max_models: int | None) -> ModelRow:
        """A class without samples and versions; one that was deleted comes back under its name."""
        alive = select(func.count()).select_from(ModelRow).where(ModelRow.deleted_at.is_(None))
        if max_models is not None and session.execute(alive).scalar_one() >= max_models:
            raise StoreFull(f"there are {max_models} models already")
        row = session.execute(select(ModelRow).where(ModelRow.name == name)).scalar_one_or_none()
        if row is None:
            row = ModelRow(name=name, version=None, last_version=0, created_at=now, updated_at=now)
            session.add(row)
        row.created_at = row.updated_at = now
        row.deleted_at = None
        session.flush()
        return row
