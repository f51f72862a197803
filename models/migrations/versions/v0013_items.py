"""Column for the labels of the columns of a class's table."""

from typing import Literal

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # SQLite creates the table again, so that a migrated database equals a new one.
    recreate: Literal["always", "never"] = "always" if op.get_bind().dialect.name == "sqlite" else "never"
    with op.batch_alter_table("layout_models", recreate=recreate) as models:
        models.add_column(sa.Column("items", sa.LargeBinary(), nullable=True))


def downgrade() -> None:
    with op.batch_alter_table("layout_models") as models:
        models.drop_column("items")
