"""Samples know the version after which they came, and claims when they began: neither order depends on clocks."""

from typing import Literal

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # SQLite creates the table again, so that a migrated database equals a new one.
    recreate: Literal["always", "never"] = "always" if op.get_bind().dialect.name == "sqlite" else "never"
    with op.batch_alter_table("layout_samples", recreate=recreate) as samples:
        samples.add_column(sa.Column("after_version", sa.Integer(), nullable=True))
    # A sample from feedback has the time of the version that was made with it, and came before it.
    op.execute(
        "UPDATE layout_samples SET after_version = COALESCE((SELECT MAX(made.version) "
        "FROM layout_model_versions AS made WHERE made.model_id = layout_samples.model_id "
        "AND made.created_at < layout_samples.created_at), 0)"
    )
    with op.batch_alter_table("layout_samples", recreate=recreate) as samples:
        samples.alter_column("after_version", existing_type=sa.Integer(), nullable=False)
    with op.batch_alter_table("layout_reviews", recreate=recreate) as reviews:
        reviews.add_column(sa.Column("claimed_at", sa.DateTime(timezone=True), nullable=True))
    op.execute("UPDATE layout_reviews SET claimed_at = created_at WHERE claimed_until IS NOT NULL")
