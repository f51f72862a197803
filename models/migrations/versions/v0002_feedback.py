"""Tables and columns for feedback, settings of a class, samples from feedback, and unknown pages."""

from typing import Literal

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

MOMENT = sa.DateTime(timezone=True)


def upgrade() -> None:
    # SQLite creates the table again, so that a migrated database equals a new one.
    recreate: Literal["always", "never"] = "always" if op.get_bind().dialect.name == "sqlite" else "never"
    with op.batch_alter_table("layout_models", recreate=recreate) as models:
        models.add_column(sa.Column("learner", sa.String(20), nullable=True))
        models.add_column(sa.Column("genre", sa.String(200), nullable=True))
        models.add_column(sa.Column("continues", sa.String(200), nullable=True))
    with op.batch_alter_table("layout_samples", recreate=recreate) as samples:
        samples.add_column(sa.Column("origin", sa.String(20), nullable=False, server_default="posted"))
        samples.add_column(sa.Column("result_id", sa.String(26), nullable=True))
    op.create_index("ix_layout_samples_result_id", "layout_samples", ["result_id"])
    op.create_table(
        "layout_feedback",
        sa.Column("id", sa.String(26), nullable=False),
        sa.Column("result_id", sa.String(26), nullable=False),
        sa.Column("key", sa.String(200), nullable=True),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.Column("found_class", sa.String(200), nullable=True),
        sa.Column("verified_class", sa.String(200), nullable=True),
        sa.Column("zones", sa.Integer(), nullable=False),
        sa.Column("wrong_zones", sa.Integer(), nullable=False),
        sa.Column("class_wrong", sa.Boolean(), nullable=False),
        sa.Column("sample_id", sa.String(26), nullable=True),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("request", sa.LargeBinary(), nullable=False),
        sa.Column("report", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_layout_feedback"),
        sa.ForeignKeyConstraint(
            ["sample_id"],
            ["layout_samples.id"],
            name="fk_layout_feedback_sample_id",
            ondelete="SET NULL",
        ),
        sa.UniqueConstraint("result_id", "digest", name="uq_layout_feedback_result_id_digest"),
        sa.UniqueConstraint("key", name="uq_layout_feedback_key"),
    )
    op.create_index("ix_layout_feedback_sample_id", "layout_feedback", ["sample_id"])
    op.create_table(
        "layout_feedback_models",
        sa.Column("model_id", sa.Integer(), nullable=False),
        sa.Column("feedback_id", sa.String(26), nullable=False),
        sa.Column("old_version", sa.Integer(), nullable=True),
        sa.Column("new_version", sa.Integer(), nullable=True),
        sa.PrimaryKeyConstraint("model_id", "feedback_id", name="pk_layout_feedback_models"),
        sa.ForeignKeyConstraint(
            ["model_id"], ["layout_models.id"], name="fk_layout_feedback_models_model_id"
        ),
        sa.ForeignKeyConstraint(
            ["feedback_id"],
            ["layout_feedback.id"],
            name="fk_layout_feedback_models_feedback_id",
            ondelete="CASCADE",
        ),
    )
    op.create_index("ix_layout_feedback_models_feedback_id", "layout_feedback_models", ["feedback_id"])
    op.create_table(
        "layout_unknown_pages",
        sa.Column("id", sa.String(26), nullable=False),
        sa.Column("result_id", sa.String(26), nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("expires_at", MOMENT, nullable=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_layout_unknown_pages"),
        sa.UniqueConstraint("result_id", name="uq_layout_unknown_pages_result_id"),
    )
    op.create_index("ix_layout_unknown_pages_expires_at", "layout_unknown_pages", ["expires_at"])
