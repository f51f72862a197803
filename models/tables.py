"""The tables, as SQLAlchemy maps them. What changes here needs a migration (a test compares the two)."""

from datetime import UTC, datetime

from sqlalchemy import BigInteger, DateTime, Dialect, ForeignKey, LargeBinary, MetaData, String, Text
from sqlalchemy import UniqueConstraint as Unique
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column
from sqlalchemy.types import TypeDecorator

MAX_NAME = 200
"""Characters of a class's name or of an idempotency key."""


class UtcDateTime(TypeDecorator[datetime]):
    """Aware times, in UTC: SQLite has no time zones, PostgreSQL answers in that of its session."""

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
    """One row. Writers of models lock it first, so that they queue on any database as they do on SQLite."""

    __tablename__ = "store_state"

    id: Mapped[int] = mapped_column(primary_key=True)
    revision: Mapped[int] = mapped_column(BigInteger)


class ModelRow(Table):
    """A document class. A deleted one stays, so that its versions are neither lost nor counted again."""

    __tablename__ = "layout_models"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(MAX_NAME), unique=True)
    version: Mapped[int | None]
    last_version: Mapped[int]
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    updated_at: Mapped[datetime] = mapped_column(UtcDateTime)
    deleted_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    # Settings; a learner that is NULL is the default of the release that runs.
    learner: Mapped[str | None] = mapped_column(String(20))
    genre: Mapped[str | None] = mapped_column(String(MAX_NAME))
    continues: Mapped[str | None] = mapped_column(String(MAX_NAME))


class VersionRow(Table):
    """A version of a model: written once, never changed."""

    __tablename__ = "layout_model_versions"

    model_id: Mapped[int] = mapped_column(ForeignKey("layout_models.id"), primary_key=True)
    version: Mapped[int] = mapped_column(primary_key=True)
    origin: Mapped[str] = mapped_column(String(20))
    note: Mapped[str] = mapped_column(Text)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class SampleRow(Table):
    """A labelled page of a class: once for each content, once for each key.

    One that came by feedback names the result that it verifies, and goes when that result is verified anew.
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


class FeedbackRow(Table):
    """What a person said of a result: once for each body, once for each key. The result itself may be gone."""

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


class FeedbackModelRow(Table):
    """A class that a feedback is about (found, verified, or both), and the versions between which it changed it."""

    __tablename__ = "layout_feedback_models"

    model_id: Mapped[int] = mapped_column(ForeignKey("layout_models.id"), primary_key=True)
    feedback_id: Mapped[str] = mapped_column(
        ForeignKey("layout_feedback.id", ondelete="CASCADE"), primary_key=True, index=True
    )
    old_version: Mapped[int | None]
    new_version: Mapped[int | None]


class UnknownPageRow(Table):
    """A page that fitted no class, for a while: once for each result."""

    __tablename__ = "layout_unknown_pages"

    id: Mapped[str] = mapped_column(String(26), primary_key=True)
    result_id: Mapped[str] = mapped_column(String(26), unique=True)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    expires_at: Mapped[datetime] = mapped_column(UtcDateTime, index=True)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class ResultRow(Table):
    """The answer to a recognition, for a while."""

    __tablename__ = "layout_results"

    id: Mapped[str] = mapped_column(String(26), primary_key=True)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    expires_at: Mapped[datetime] = mapped_column(UtcDateTime, index=True)
    document: Mapped[bytes] = mapped_column(LargeBinary)
