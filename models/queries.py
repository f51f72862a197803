"""Steps that the calls of the repository share: finding rows, judging what may be stored, rows as plain values."""

from typing import cast

from sqlalchemy import ColumnElement, func, select
from sqlalchemy.orm import Session

from models.documents import decode_document
from models.errors import ModelNotFound, NotStorable, SampleNotFound, VersionConflict
from models.records import AnyVersion, ExpectedVersion, Origin, StoredModel, StoredSample
from models.tables import MAX_NAME, ModelRow, SampleRow, VersionRow
from models.ulid import is_ulid


def look_up_model(session: Session, name: str) -> ModelRow | None:
    if not is_storable(name):
        return None
    alive = select(ModelRow).where(ModelRow.name == name, ModelRow.deleted_at.is_(None))
    return session.execute(alive).scalar_one_or_none()


def find_model(session: Session, name: str) -> ModelRow:
    row = look_up_model(session, name)
    if row is None:
        raise ModelNotFound(f"there is no model {name!r}", name)
    return row


def find_sample(session: Session, name: str, sample_id: str) -> SampleRow:
    model = find_model(session, name)
    row = session.get(SampleRow, sample_id) if is_ulid(sample_id) else None
    if row is None or row.model_id != model.id:
        raise SampleNotFound(f"the model {name!r} has no sample {sample_id!r}", sample_id)
    return row


def count_samples() -> ColumnElement[int]:
    """The number of samples of the class that a query is about."""
    count = select(func.count()).where(SampleRow.model_id == ModelRow.id).correlate(ModelRow)
    return count.scalar_subquery()


def require_version(name: str, current: int | None, expected: ExpectedVersion) -> None:
    if isinstance(expected, AnyVersion) or expected == current:
        return
    has = "no version" if current is None else f"version {current}"
    wanted = "none" if expected is None else expected
    raise VersionConflict(f"the model {name!r} has {has}, expected was {wanted}", current)


def is_text(text: str) -> bool:
    """Whether every database takes these characters: no zero, no half of a surrogate pair."""
    return "\0" not in text and not any("\ud800" <= character <= "\udfff" for character in text)


def is_storable(name: str) -> bool:
    return 0 < len(name) <= MAX_NAME and is_text(name)


def require_storable(text: str, what: str) -> None:
    if not is_storable(text):
        raise NotStorable(
            f"the {what} must have 1 to {MAX_NAME} characters, none of them a zero or a surrogate"
        )


def stored_model(row: ModelRow, samples: int, version: VersionRow | None) -> StoredModel:
    return StoredModel(
        name=row.name,
        version=None if version is None else version.version,
        document=None if version is None else decode_document(version.document),
        samples=samples,
        created_at=row.created_at,
        updated_at=row.updated_at,
        origin=None if version is None else cast(Origin, version.origin),
    )


def stored_sample(row: SampleRow, *, created: bool) -> StoredSample:
    return StoredSample(row.id, decode_document(row.document), row.created_at, created)
