"""Layout graph models with all their versions, samples, results."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

MOMENT = sa.DateTime(timezone=True)


def upgrade() -> None:
    state = op.create_table(
        "store_state",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("revision", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_store_state"),
    )
    op.bulk_insert(state, [{"id": 1, "revision": 0}])
    op.create_table(
        "layout_models",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("version", sa.Integer(), nullable=True),
        sa.Column("last_version", sa.Integer(), nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("updated_at", MOMENT, nullable=False),
        sa.Column("deleted_at", MOMENT, nullable=True),
        sa.PrimaryKeyConstraint("id", name="pk_layout_models"),
        sa.UniqueConstraint("name", name="uq_layout_models_name"),
    )
    op.create_table(
        "layout_model_versions",
        sa.Column("model_id", sa.Integer(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("origin", sa.String(20), nullable=False),
        sa.Column("note", sa.Text(), nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("model_id", "version", name="pk_layout_model_versions"),
        sa.ForeignKeyConstraint(["model_id"], ["layout_models.id"], name="fk_layout_model_versions_model_id"),
    )
    op.create_table(
        "layout_samples",
        sa.Column("id", sa.String(26), nullable=False),
        sa.Column("model_id", sa.Integer(), nullable=False),
        sa.Column("key", sa.String(200), nullable=True),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_layout_samples"),
        sa.ForeignKeyConstraint(["model_id"], ["layout_models.id"], name="fk_layout_samples_model_id"),
        sa.UniqueConstraint("model_id", "digest", name="uq_layout_samples_model_id_digest"),
        sa.UniqueConstraint("model_id", "key", name="uq_layout_samples_model_id_key"),
    )
    op.create_table(
        "layout_results",
        sa.Column("id", sa.String(26), nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("expires_at", MOMENT, nullable=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_layout_results"),
    )
    op.create_index("ix_layout_results_expires_at", "layout_results", ["expires_at"])
