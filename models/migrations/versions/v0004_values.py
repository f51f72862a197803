"""Columns for the types of fields and the elements of HTML pages of a class, and for corrected texts of feedback."""

from typing import Literal

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # SQLite creates the table again, so that a migrated database equals a new one.
    recreate: Literal["always", "never"] = "always" if op.get_bind().dialect.name == "sqlite" else "never"
    with op.batch_alter_table("layout_models", recreate=recreate) as models:
        models.add_column(sa.Column("fields", sa.LargeBinary(), nullable=True))
        models.add_column(sa.Column("elements", sa.LargeBinary(), nullable=True))
    with op.batch_alter_table("layout_feedback", recreate=recreate) as feedback:
        feedback.add_column(sa.Column("letters", sa.Integer(), nullable=True))
        feedback.add_column(sa.Column("wrong_letters", sa.Integer(), nullable=True))
