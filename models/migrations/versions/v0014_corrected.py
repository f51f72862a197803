"""Column for whether feedback found anything of a result wrong."""

from typing import Literal

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # SQLite creates the table again, so that a migrated database equals a new one.
    recreate: Literal["always", "never"] = "always" if op.get_bind().dialect.name == "sqlite" else "never"
    with op.batch_alter_table("layout_feedback", recreate=recreate) as feedback:
        feedback.add_column(sa.Column("is_corrected", sa.Boolean(), nullable=True))


def downgrade() -> None:
    with op.batch_alter_table("layout_feedback") as feedback:
        feedback.drop_column("is_corrected")
