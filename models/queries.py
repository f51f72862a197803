"""Steps that several repositories use: they find rows, check values before storing, and convert rows to records."""

from collections.abc import Iterable
from dataclasses import asdict
from datetime import datetime, timedelta
from typing import cast, get_args

from sqlalchemy import ColumnElement, delete, func, or_, select
from sqlalchemy.orm import InstrumentedAttribute, Session

from models.documents import decode_document, encode_document
from models.errors import ModelNotFound, NotStorable, SampleNotFound, StoreFull, VersionConflict
from models.records import (
    MAX_NAME,
    MOST_INTEGER,
    AnyVersion,
    ClassSummary,
    ExpectedVersion,
    ModelSettings,
    Origin,
    ReviewDraft,
    SampleOrigin,
    StoredModel,
    StoredSample,
    UnknownPageDraft,
)
from models.tables import (
    FeedbackRow,
    ModelRow,
    ResultRow,
    ReviewRow,
    SampleRow,
    StateRow,
    UnknownPageRow,
    VersionRow,
)
from models.ulid import is_ulid
from services.contract.fields import MOST_COLUMNS, MOST_FIELDS, FieldSetting, FieldSettingJson
from services.contract.html import HtmlElement
from services.contract.layout_learning import DEFAULT_LEARNER, Learner
from services.contract.model_json import ModelJson
from services.contract.page_json import SampleJson

READ_AT_ONCE = 8
"""Rows with documents; each has a few MB at most."""
IDS_AT_ONCE = 500
"""Ids in one statement; SQLite accepts 32,766 parameters."""


def something_wrong() -> ColumnElement[bool]:
    """Whether a feedback found anything of its result wrong; rows of earlier releases have counts only."""
    counts = (
        FeedbackRow.class_wrong,
        FeedbackRow.wrong_zones > 0,
        func.coalesce(FeedbackRow.wrong_letters, 0) > 0,
    )
    return or_(func.coalesce(FeedbackRow.is_corrected, False), *counts)


def review_of(row: ResultRow, place: ReviewDraft) -> ReviewRow:
    """The entry of a result in the review queue, open and claimed by nobody."""
    return ReviewRow(
        result_id=row.id,
        is_skipped=False,
        owner=row.owner,
        created_at=row.created_at,
        expires_at=row.expires_at,
        **asdict(place),
    )


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


def find_version(session: Session, row: ModelRow, version: int) -> VersionRow:
    found = session.get(VersionRow, (row.id, version)) if 0 < version <= MOST_INTEGER else None
    if found is None:
        raise ModelNotFound(f"the model {row.name!r} has no version {version}", row.name)
    return found


def find_sample(session: Session, name: str, sample_id: str) -> SampleRow:
    model = find_model(session, name)
    row = session.get(SampleRow, sample_id) if is_ulid(sample_id) else None
    if row is None or row.model_id != model.id:
        raise SampleNotFound(f"the model {name!r} has no sample {sample_id!r}", sample_id)
    return row


def create_model(session: Session, name: str, now: datetime, max_models: int | None) -> ModelRow:
    """A class without samples and settings. A deleted class of the same name is used again."""
    alive = select(func.count()).select_from(ModelRow).where(ModelRow.deleted_at.is_(None))
    if max_models is not None and session.execute(alive).scalar_one() >= max_models:
        raise StoreFull(f"there are {max_models} models already")
    row = session.execute(select(ModelRow).where(ModelRow.name == name)).scalar_one_or_none()
    if row is None:
        row = ModelRow(name=name, version=None, last_version=0, created_at=now, updated_at=now)
        session.add(row)
    row.created_at = row.updated_at = now
    row.deleted_at = row.learner = row.genre = row.continues = row.fields = row.elements = row.items = None
    session.flush()
    return row


def append_version(
    session: Session,
    state: StateRow,
    row: ModelRow,
    packed: bytes,
    origin: Origin,
    note: str,
    now: datetime,
    *,
    parent: int | None = None,
) -> VersionRow:
    """Make an encoded document the newest version of a class; `parent` is the version that it was made from."""
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
        parent=parent,
    )
    session.add(version)
    session.flush()
    return version


def add_unknown_page(
    session: Session, page_id: str, result_id: str, draft: UnknownPageDraft, now: datetime
) -> None:
    """Store a page that fits no class, once for each result. The oldest pages are deleted for it."""
    of_result = select(UnknownPageRow.id).where(
        UnknownPageRow.result_id == result_id, UnknownPageRow.expires_at > now
    )
    if session.execute(of_result).first() is not None:
        return
    expired = (UnknownPageRow.expires_at <= now) | (UnknownPageRow.result_id == result_id)
    session.execute(delete(UnknownPageRow).where(expired))
    row = UnknownPageRow(
        id=page_id,
        result_id=result_id,
        created_at=now,
        expires_at=now + timedelta(seconds=draft.ttl_s),
        document=encode_document(draft.page),
        owner=draft.owner,
    )
    session.add(row)
    session.flush()
    newest = select(UnknownPageRow.id).order_by(UnknownPageRow.id.desc()).offset(draft.bound).limit(1)
    last = session.execute(newest).scalar_one_or_none()
    if last is not None:
        session.execute(delete(UnknownPageRow).where(UnknownPageRow.id <= last))


def count_samples() -> ColumnElement[int]:
    """The number of samples of the class that a query is about."""
    count = select(func.count()).where(SampleRow.model_id == ModelRow.id).correlate(ModelRow)
    return count.scalar_subquery()


def require_version(name: str, current: int | None, expected: ExpectedVersion) -> None:
    if callable(expected):
        expected(current)
        return
    if isinstance(expected, AnyVersion) or expected == current:
        return
    has = "no version" if current is None else f"version {current}"
    wanted = "none" if expected is None else expected
    raise VersionConflict(f"the model {name!r} has {has}, expected was {wanted}", current)


def is_text(text: str) -> bool:
    """Whether every database accepts these characters: no NUL, no half of a surrogate pair."""
    return "\0" not in text and not any("\ud800" <= character <= "\udfff" for character in text)


def is_storable(name: str) -> bool:
    return 0 < len(name) <= MAX_NAME and is_text(name)


def require_storable(text: str, what: str) -> None:
    if not is_storable(text):
        raise NotStorable(
            f"the {what} must have 1 to {MAX_NAME} characters, none of them a zero or a surrogate"
        )


def require_result_id(result_id: str) -> None:
    if not is_ulid(result_id):
        raise NotStorable("this is not the id of a result")


def require_settings(name: str, settings: ModelSettings) -> None:
    """Raises `NotStorable` when the class `name` cannot have these settings."""
    if settings.learner not in get_args(Learner):
        raise NotStorable(f"learner: there are {', '.join(get_args(Learner))}")
    for each in (settings.genre, settings.continues):
        if each is not None:
            require_storable(each, "name")
    for labels in (settings.fields, settings.elements):
        if len(labels) > MOST_FIELDS:
            raise NotStorable(f"a class can have settings of {MOST_FIELDS} labels")
        for label in labels:
            require_storable(label, "label")
    if len(settings.items) > MOST_COLUMNS or len(set(settings.items)) < len(settings.items):
        raise NotStorable(f"items: a table can have {MOST_COLUMNS} columns, each with a label of its own")
    for label in settings.items:
        require_storable(label, "label")
    if settings.continues == name:
        raise NotStorable("continues: a class cannot continue itself")


def settings_of(row: ModelRow) -> ModelSettings:
    fields = {} if row.fields is None else decode_document(row.fields, dict[str, FieldSettingJson])
    return ModelSettings(
        learner=cast(Learner, row.learner or DEFAULT_LEARNER),
        genre=row.genre,
        continues=row.continues,
        fields={label: _field_setting(each) for label, each in fields.items()},
        elements={} if row.elements is None else decode_document(row.elements, dict[str, HtmlElement]),
        items=() if row.items is None else tuple(decode_document(row.items, dict[str, list[str]])["labels"]),
    )


def _field_setting(stored: FieldSettingJson) -> FieldSetting:
    """The setting as a record; what an earlier release did not know has its default."""
    return FieldSetting(
        stored["type"],
        stored.get("pattern"),
        stored.get("order"),
        tuple(stored["languages"]),
        stored.get("region"),
        stored.get("currency"),
        stored.get("decimal"),
    )


def model_summary(row: ModelRow, samples: int) -> ClassSummary:
    return ClassSummary(row.name, row.version, samples, row.created_at, row.updated_at, settings_of(row))


def stored_model(row: ModelRow, samples: int, version: VersionRow | None) -> StoredModel:
    return StoredModel(
        name=row.name,
        version=None if version is None else version.version,
        document=None if version is None else decode_document(version.document, ModelJson),
        samples=samples,
        created_at=row.created_at,
        updated_at=row.updated_at,
        origin=None if version is None else cast(Origin, version.origin),
        settings=settings_of(row),
    )


def stored_sample(row: SampleRow, *, created: bool) -> StoredSample:
    return StoredSample(
        row.id,
        decode_document(row.document, SampleJson),
        row.created_at,
        created,
        cast(SampleOrigin, row.origin),
        row.result_id,
        row.after_version,
    )


def present_ids(
    session: Session, column: InstrumentedAttribute[str], ids: Iterable[str], *among: ColumnElement[bool]
) -> set[str]:
    """Those of the ids that `column` has in the rows that fulfil `among`."""
    valid, found = sorted(filter(is_ulid, ids)), set[str]()
    for at in range(0, len(valid), IDS_AT_ONCE):
        wanted = select(column).where(column.in_(valid[at : at + IDS_AT_ONCE]), *among)
        found.update(session.execute(wanted).scalars())
    return found
