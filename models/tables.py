"""The tables, as SQLAlchemy maps them. Every change needs a migration; a test compares both."""

from datetime import UTC, datetime

from sqlalchemy import (
    BigInteger,
    DateTime,
    Dialect,
    Double,
    ForeignKey,
    Index,
    LargeBinary,
    MetaData,
    String,
    Text,
)
from sqlalchemy import UniqueConstraint as Unique
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column
from sqlalchemy.types import TypeDecorator

from models.records import MAX_NAME


class UtcDateTime(TypeDecorator[datetime]):
    """Aware times in UTC. SQLite has no time zones; PostgreSQL returns the time zone of its session."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is not None and value.tzinfo is None:
            raise ValueError("a time without a time zone")
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


class Table(DeclarativeBase):
    # Batch migrations drop and change constraints by their names.
    metadata = MetaData(
        naming_convention={
            "pk": "pk_%(table_name)s",
            "fk": "fk_%(table_name)s_%(column_0_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "ix": "ix_%(table_name)s_%(column_0_name)s",
        }
    )


class StateRow(Table):
    """A single row. Writers of models lock it first, so that they queue on every database as on SQLite."""

    __tablename__ = "store_state"

    id: Mapped[int] = mapped_column(primary_key=True)
    revision: Mapped[int] = mapped_column(BigInteger)


class ModelRow(Table):
    """A document class. The row of a deleted class remains, so that its version numbers are not used again."""

    __tablename__ = "layout_models"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(MAX_NAME), unique=True)
    version: Mapped[int | None]
    last_version: Mapped[int]
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    updated_at: Mapped[datetime] = mapped_column(UtcDateTime)
    deleted_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    # Settings. NULL as the learner means the default of the running release.
    learner: Mapped[str | None] = mapped_column(String(20))
    genre: Mapped[str | None] = mapped_column(String(MAX_NAME))
    continues: Mapped[str | None] = mapped_column(String(MAX_NAME))
    fields: Mapped[bytes | None] = mapped_column(LargeBinary)
    elements: Mapped[bytes | None] = mapped_column(LargeBinary)
    items: Mapped[bytes | None] = mapped_column(LargeBinary)


class VersionRow(Table):
    """A version of a model. Its document is written once and never changes.

    `parent` is the version from which it was made; NULL: it was made from samples or imported. `undone_by` is the
    version that took back what this version learned from a feedback.
    """

    __tablename__ = "layout_model_versions"

    model_id: Mapped[int] = mapped_column(ForeignKey("layout_models.id"), primary_key=True)
    version: Mapped[int] = mapped_column(primary_key=True)
    origin: Mapped[str] = mapped_column(String(20))
    note: Mapped[str] = mapped_column(Text)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    document: Mapped[bytes] = mapped_column(LargeBinary)
    parent: Mapped[int | None]
    undone_by: Mapped[int | None]


class SampleRow(Table):
    """A labelled page of a class, once for each content and once for each key.

    A sample from feedback names the verified result, and is deleted when that result is verified again.
    `after_version` is the number of the class's last version when it came, 0 without any: order of samples and versions
    does not depend on clocks.
    """

    __tablename__ = "layout_samples"
    __table_args__ = (Unique("model_id", "digest"), Unique("model_id", "key"))

    id: Mapped[str] = mapped_column(String(26), primary_key=True)
    model_id: Mapped[int] = mapped_column(ForeignKey("layout_models.id"))
    key: Mapped[str | None] = mapped_column(String(MAX_NAME))
    digest: Mapped[str] = mapped_column(String(64))
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    document: Mapped[bytes] = mapped_column(LargeBinary)
    origin: Mapped[str] = mapped_column(String(20), server_default="posted")
    result_id: Mapped[str | None] = mapped_column(String(26), index=True)
    after_version: Mapped[int]


class FeedbackRow(Table):
    """A person's feedback on a result, once for each body and once for each key. The result itself may have expired.

    `lesson` is the verified page with all labels. The models learn from it again when an earlier feedback is taken
    back. It is NULL when a later feedback on the same result has replaced this one, or when its sample was deleted.
    `letters` counts those of the texts that the person gave, `wrong_letters` the edits that made them of the read ones.
    `is_corrected`: the person found anything wrong; NULL in rows of earlier releases, whose counts say it.
    """

    __tablename__ = "layout_feedback"
    __table_args__ = (Unique("result_id", "digest"), Unique("key"))

    id: Mapped[str] = mapped_column(String(26), primary_key=True)
    result_id: Mapped[str] = mapped_column(String(26))
    key: Mapped[str | None] = mapped_column(String(MAX_NAME))
    digest: Mapped[str] = mapped_column(String(64))
    found_class: Mapped[str | None] = mapped_column(String(MAX_NAME))
    verified_class: Mapped[str | None] = mapped_column(String(MAX_NAME))
    zones: Mapped[int]
    wrong_zones: Mapped[int]
    class_wrong: Mapped[bool]
    sample_id: Mapped[str | None] = mapped_column(
        ForeignKey("layout_samples.id", ondelete="SET NULL"), index=True
    )
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    request: Mapped[bytes] = mapped_column(LargeBinary)
    report: Mapped[bytes] = mapped_column(LargeBinary)
    lesson: Mapped[bytes | None] = mapped_column(LargeBinary)
    owner: Mapped[str | None] = mapped_column(String(MAX_NAME), index=True)
    letters: Mapped[int | None]
    wrong_letters: Mapped[int | None]
    is_corrected: Mapped[bool | None]


class FeedbackModelRow(Table):
    """A class of a feedback (found, verified, or both), with its version before and after the feedback."""

    __tablename__ = "layout_feedback_models"

    model_id: Mapped[int] = mapped_column(ForeignKey("layout_models.id"), primary_key=True)
    feedback_id: Mapped[str] = mapped_column(
        ForeignKey("layout_feedback.id", ondelete="CASCADE"), primary_key=True, index=True
    )
    old_version: Mapped[int | None]
    new_version: Mapped[int | None]


class UnknownPageRow(Table):
    """A page that fitted no class, once for each result. It expires."""

    __tablename__ = "layout_unknown_pages"

    id: Mapped[str] = mapped_column(String(26), primary_key=True)
    result_id: Mapped[str] = mapped_column(String(26), unique=True)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    expires_at: Mapped[datetime] = mapped_column(UtcDateTime, index=True)
    document: Mapped[bytes] = mapped_column(LargeBinary)
    owner: Mapped[str | None] = mapped_column(String(MAX_NAME), index=True)


class ResultRow(Table):
    """The result of a recognition. It expires.

    `owner` is the name of the API key that made it; NULL: made without keys. The other tables use it in the same way.
    """

    __tablename__ = "layout_results"

    id: Mapped[str] = mapped_column(String(26), primary_key=True)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    expires_at: Mapped[datetime] = mapped_column(UtcDateTime, index=True)
    document: Mapped[bytes] = mapped_column(LargeBinary)
    owner: Mapped[str | None] = mapped_column(String(MAX_NAME), index=True)


class KeptPageRow(Table):
    """A page whose photo is kept for later answers. It expires."""

    __tablename__ = "kept_pages"

    id: Mapped[str] = mapped_column(String(26), primary_key=True)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    expires_at: Mapped[datetime] = mapped_column(UtcDateTime, index=True)
    document: Mapped[bytes] = mapped_column(LargeBinary)
    owner: Mapped[str | None] = mapped_column(String(MAX_NAME), index=True)


class UploadRow(Table):
    """An upload that arrives in pieces until `received` is `length`.

    `pieces` is JSON: name of the blob and number of bytes of each piece, in their order.
    """

    __tablename__ = "uploads"

    id: Mapped[str] = mapped_column(String(26), primary_key=True)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    expires_at: Mapped[datetime] = mapped_column(UtcDateTime, index=True)
    owner: Mapped[str | None] = mapped_column(String(MAX_NAME), index=True)
    name: Mapped[str | None] = mapped_column(Text)
    length: Mapped[int] = mapped_column(BigInteger)
    received: Mapped[int] = mapped_column(BigInteger)
    pieces: Mapped[str] = mapped_column(Text)


class JobRow(Table):
    """An accepted job. Its input and its answer are blobs; the queue knows its id only.

    `token` names the lease of the worker that runs it. `repeat_key` is that of its Idempotency-Key. A queued job does
    not start before `ready_at`. `returns` counts how often it was handed back without an attempt.
    """

    __tablename__ = "jobs"
    __table_args__ = (Unique("repeat_key"),)

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    owner: Mapped[str | None] = mapped_column(String(MAX_NAME))
    operation: Mapped[str] = mapped_column(String(MAX_NAME))
    request: Mapped[bytes] = mapped_column(LargeBinary)
    input_key: Mapped[str | None] = mapped_column(String(MAX_NAME))
    input_bytes: Mapped[int] = mapped_column(BigInteger)
    repeat_key: Mapped[str | None] = mapped_column(String(64))
    digest: Mapped[str | None] = mapped_column(String(64))
    priority: Mapped[int]
    state: Mapped[str] = mapped_column(String(20), index=True)
    stage: Mapped[str | None] = mapped_column(String(100))
    progress: Mapped[float] = mapped_column(Double)
    revision: Mapped[int]
    attempts: Mapped[int]
    returns: Mapped[int]
    token: Mapped[str | None] = mapped_column(String(32))
    lease_until: Mapped[datetime | None] = mapped_column(UtcDateTime)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    ready_at: Mapped[datetime] = mapped_column(UtcDateTime)
    started_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    ended_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    expires_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    answer: Mapped[bytes | None] = mapped_column(LargeBinary)
    answer_key: Mapped[str | None] = mapped_column(String(MAX_NAME))
    answer_bytes: Mapped[int] = mapped_column(BigInteger)
    problem: Mapped[bytes | None] = mapped_column(LargeBinary)
    callback_url: Mapped[str | None] = mapped_column(Text)
    callback_at: Mapped[datetime | None] = mapped_column(UtcDateTime, index=True)
    deliveries: Mapped[bytes | None] = mapped_column(LargeBinary)


class ReviewRow(Table):
    """Place of a page's result in the review queue. Whether it is open follows from its feedback.

    `gain` and `confidence` are computed when the page is recognized. `claim` is a secret of the person who works on it.
    `model_version` is the version of the class's model that `gain` and `confidence` are from.
    `owner`, `created_at` and `expires_at` are those of the result, so that the queue is read without the large rows of
    results.
    """

    __tablename__ = "layout_reviews"
    __table_args__ = (
        Index("ix_layout_reviews_gain", "gain", "result_id"),
        Index("ix_layout_reviews_confidence", "confidence", "result_id"),
    )

    result_id: Mapped[str] = mapped_column(
        ForeignKey("layout_results.id", ondelete="CASCADE"), primary_key=True
    )
    gain: Mapped[float]
    confidence: Mapped[float]
    class_name: Mapped[str | None] = mapped_column(String(MAX_NAME))
    zones: Mapped[int]
    decision: Mapped[str] = mapped_column(String(10))
    has_image: Mapped[bool]
    is_skipped: Mapped[bool]
    claim: Mapped[str | None] = mapped_column(String(64))
    claimed_by: Mapped[str | None] = mapped_column(String(MAX_NAME))
    claimed_until: Mapped[datetime | None] = mapped_column(UtcDateTime)
    owner: Mapped[str | None] = mapped_column(String(MAX_NAME))
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    expires_at: Mapped[datetime] = mapped_column(UtcDateTime)
    model_version: Mapped[int | None]
    claimed_at: Mapped[datetime | None] = mapped_column(UtcDateTime)


class CameraRow(Table):
    """What pages have shown of a camera's focal length. `owner` is the name of an API key; empty: no key."""

    __tablename__ = "cameras"

    owner: Mapped[str] = mapped_column(String(MAX_NAME), primary_key=True)
    name: Mapped[str] = mapped_column(String(100), primary_key=True)
    seen: Mapped[str] = mapped_column(Text)
    """JSON: pairs (log focal length, its standard deviation), the newest last."""
    used_at: Mapped[datetime] = mapped_column(UtcDateTime, index=True)


class SharedValueRow(Table):
    """A small value that all processes share: the secret that signs tokens, and which processes are there."""

    __tablename__ = "shared_values"

    name: Mapped[str] = mapped_column(String(40), primary_key=True)
    value: Mapped[bytes] = mapped_column(LargeBinary)
    written_at: Mapped[datetime] = mapped_column(UtcDateTime)


class AuditRow(Table):
    """One entry of the list of who changed what, and when. `who` is the name of an API key; NULL: no key."""

    __tablename__ = "layout_audit"

    id: Mapped[str] = mapped_column(String(26), primary_key=True)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    who: Mapped[str | None] = mapped_column(String(MAX_NAME))
    action: Mapped[str] = mapped_column(String(40))
    model: Mapped[str | None] = mapped_column(String(MAX_NAME), index=True)
    detail: Mapped[str] = mapped_column(Text)
