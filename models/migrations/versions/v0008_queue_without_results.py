"""The review queue has owner and times of its results, the version of their model, and an index for each order."""

from typing import Literal

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None

COPIED = ("owner", "created_at", "expires_at")
ORDERS = ("gain", "confidence")


def upgrade() -> None:
    for order in ORDERS:
        op.drop_index(f"ix_layout_reviews_{order}", "layout_reviews")
    # SQLite creates the table again, so that a migrated database equals a new one.
    recreate: Literal["always", "never"] = "always" if op.get_bind().dialect.name == "sqlite" else "never"
    with op.batch_alter_table("layout_reviews", recreate=recreate) as reviews:
        reviews.add_column(sa.Column("owner", sa.String(200), nullable=True))
        for time in ("created_at", "expires_at"):
            reviews.add_column(sa.Column(time, sa.DateTime(timezone=True), nullable=True))
        reviews.add_column(sa.Column("model_version", sa.Integer(), nullable=True))
    for column in COPIED:
        op.execute(
            f"UPDATE layout_reviews SET {column} = (SELECT result.{column} FROM layout_results AS result "
            "WHERE result.id = layout_reviews.result_id)"
        )
    with op.batch_alter_table("layout_reviews", recreate=recreate) as reviews:
        for time in ("created_at", "expires_at"):
            reviews.alter_column(time, existing_type=sa.DateTime(timezone=True), nullable=False)
    for order in ORDERS:
        op.create_index(f"ix_layout_reviews_{order}", "layout_reviews", [order, "result_id"])
