"""Columns to take feedback back, and the owners of results, feedback and unknown pages."""

from typing import Literal

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

OWNED = ("layout_feedback", "layout_unknown_pages", "layout_results")


def upgrade() -> None:
    # SQLite creates the table again, so that a migrated database equals a new one.
    recreate: Literal["always", "never"] = "always" if op.get_bind().dialect.name == "sqlite" else "never"
    with op.batch_alter_table("layout_model_versions", recreate=recreate) as versions:
        versions.add_column(sa.Column("parent", sa.Integer(), nullable=True))
        versions.add_column(sa.Column("undone_by", sa.Integer(), nullable=True))
    for table in OWNED:
        with op.batch_alter_table(table, recreate=recreate) as owned:
            if table == "layout_feedback":
                owned.add_column(sa.Column("lesson", sa.LargeBinary(), nullable=True))
            owned.add_column(sa.Column("owner", sa.String(200), nullable=True))
        op.create_index(f"ix_{table}_owner", table, ["owner"])
    op.execute("UPDATE layout_model_versions SET parent = version - 1 WHERE origin = 'train' AND version > 1")
    op.execute(
        "UPDATE layout_model_versions SET parent = (SELECT old_version FROM layout_feedback_models AS taught "
        "WHERE taught.model_id = layout_model_versions.model_id "
        "AND taught.new_version = layout_model_versions.version) WHERE origin = 'feedback'"
    )
