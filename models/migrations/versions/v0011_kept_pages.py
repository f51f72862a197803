"""Table of kept photos: the pages that they show, with what later answers need; they expire."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "kept_pages",
        sa.Column("id", sa.String(length=26), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("expires_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
        sa.Column("owner", sa.String(length=200), nullable=True),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_kept_pages")),
    )
    op.create_index(op.f("ix_kept_pages_expires_at"), "kept_pages", ["expires_at"])
    op.create_index(op.f("ix_kept_pages_owner"), "kept_pages", ["owner"])


def downgrade() -> None:
    op.drop_table("kept_pages")
